"""Folders exported from a scan: Record3D, ScanNet, ZED.

Record3D (iPhone, iPad; https://record3d.app/features), OpenGL axes, K counts pixels of the color image:

    metadata.json    K (9 numbers, column by column), w, h, fps,
                     poses (qx qy qz qw tx ty tz, world from camera)
    rgb/0.jpg        depth/0.exr in metres, at the size of the depth sensor     both may be below EXR_RGBD/

ScanNet (https://github.com/ScanNet/ScanNet). Depth and color are assumed to be registered: the offset between
the two cameras, a few centimetres at most, is not applied:

    color/0.jpg  depth/0.png        depth in millimetres, any size
    pose/0.txt                      4 x 4, world from camera, OpenCV axes; -inf where tracking was lost
    intrinsic/intrinsic_color.txt   intrinsic/intrinsic_depth.txt     4 x 4

Frames of a ZED recording (SVO): rectified left images, optional right ones, and depth. Integer depth is in
millimetres, float depth in metres; NaN is unknown, -inf too near, +inf too far. Poses are not exported:

    left000000.png  right000000.png  depth000000.png or .exr, .npy          in one folder
    calibration.json                                   fx, fy, cx, cy of the rectified images, baseline [m]
"""

from pathlib import Path

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.data.capture import FRAME_RATE
from digs_warp.data.images import MM_PER_METRE, image_size
from digs_warp.formats.captures.recording import (
    IMAGE_SUFFIXES,
    DepthCamera,
    NumberedFiles,
    Recording,
    known_pose,
    numbered_files,
    placed,
    read_numbers,
)
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL
from digs_warp.record.fields import ABOVE_ZERO, Fields
from digs_warp.record.files import read_json

METADATA = "metadata.json"


def read_record3d(folder: Path) -> Recording:
    """Read an export "EXR + RGB" of Record3D.

    Raises:
        CaptureError: no images or metadata, or metadata without a camera.
    """
    base = "EXR_RGBD/" if (folder / "EXR_RGBD").is_dir() else ""
    files = NumberedFiles.find(folder, f"{base}rgb/", f"{base}depth/")
    path = folder / METADATA if (folder / METADATA).is_file() else folder / base / METADATA
    metadata = Fields(read_json(path, "metadata"), f"'{path}'", CaptureError)
    cameras = _cameras(metadata, files)
    rows = metadata.array("poses", (-1, 7), default=np.zeros((0, 7)))
    found = {i: placed(row[:4], row[4:]) for i, row in enumerate(rows)}
    poses = {i: pose @ OPENCV_FROM_OPENGL for i, pose in found.items() if pose is not None}
    rate = metadata.number("fps", 0, default=0.0) or FRAME_RATE
    return files.recording(cameras, poses, frame_rate=rate)


def _cameras(metadata: Fields, files: NumberedFiles) -> Intrinsics | dict[int, Intrinsics]:
    """The camera of all images, or one for each where the phone wrote them (autofocus)."""
    size = files.image_size
    written = metadata.number("w", 1, default=size[0]), metadata.number("h", 1, default=size[1])
    if (written[0] > written[1]) != (
        size[0] > size[1]
    ):  # a phone turns its images, not always these
        written = written[::-1]
    scale = size[0] / written[0]
    matrix = metadata.array("K", (3, 3)).T
    row = np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]])
    own = metadata.array("perFrameIntrinsicCoeffs", (-1, 4), default=np.zeros((0, 4)))
    rows = own if len(own) == len(files.images) else np.tile(row, (len(files.images), 1))
    if not len(own):
        return Intrinsics(*size, *_turned(row * scale, size))
    return {
        number: Intrinsics(*size, *_turned(each * scale, size))
        for number, each in zip(files.images, rows, strict=True)
    }


def _turned(row: np.ndarray, size: tuple[int, int]) -> list[float]:
    """Return fx, fy, cx, cy; exchanged if only then the principal point is near the middle of the image."""
    far, near = (np.abs(row[order] / size - 0.5).max() for order in ([2, 3], [3, 2]))
    return (row if far <= max(near, 0.1) else row[[1, 0, 3, 2]]).tolist()


def read_scannet(folder: Path) -> Recording:
    """Read a scene exported by ScanNet's SensReader, or another folder with the same layout.

    Raises:
        CaptureError: no images, or broken matrices.
    """
    files = NumberedFiles.find(folder, "color/", "depth/")
    color_k = read_numbers(folder / "intrinsic/intrinsic_color.txt", (4, 4), "camera")
    depth_camera = None
    if files.depths:
        depth_k = read_numbers(folder / "intrinsic/intrinsic_depth.txt", (4, 4), "depth camera")
        size = image_size(next(iter(files.depths.values())))
        depth_camera = DepthCamera(Intrinsics.from_matrix(depth_k, *size, first_center=0))
    poses = numbered_files(folder, "pose/", (".txt",))
    return files.recording(
        Intrinsics.from_matrix(color_k, *files.image_size, first_center=0),
        {number: known_pose(read_numbers(path, (4, 4), "pose")) for number, path in poses.items()},
        depth_camera=depth_camera,
    )


CALIBRATION = "calibration.json"

# No camera that a hand carries has eyes this far apart [m]; the SDK gives millimetres unless told otherwise.
WIDEST = 2.0


def read_zed(folder: Path) -> Recording:
    """Read left images and depth as the ZED SDK's export samples write them.

    Raises:
        CaptureError: no left images, or no usable calibration.json.
    """
    files = NumberedFiles.find(folder, "left", "depth")
    path = folder / CALIBRATION
    content = read_json(path, "calibration of the rectified left camera")
    calibration = Fields(content, f"'{path}'", CaptureError)
    fx, fy = (calibration.number(key, ABOVE_ZERO, what="pixels above 0") for key in ("fx", "fy"))
    baseline = calibration.number("baseline", ABOVE_ZERO, default=None, what="metres above 0")
    if baseline is not None and baseline > WIDEST:
        raise CaptureError(
            f"'{path}': baseline is {baseline:g}, expected metres, at most {WIDEST:g}; if it is in "
            f"millimetres, as the ZED SDK has it, write {baseline / MM_PER_METRE:g}"
        )
    return files.recording(
        Intrinsics(*files.image_size, fx, fy, calibration.number("cx"), calibration.number("cy")),
        {},
        baseline=baseline,
        right=numbered_files(folder, "right", IMAGE_SUFFIXES) if baseline is not None else {},
    )
