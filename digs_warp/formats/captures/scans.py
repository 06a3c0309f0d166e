"""Scans of phones and depth cameras: Record3D, ScanNet, ZED, Polycam, Stray Scanner.

docs/recordings.md has their layouts. What they leave open: Record3D (https://record3d.app/features) and
Polycam (https://github.com/PolyCam/polyform, y up) have OpenGL axes, Record3D its K column by column and for
the size of the color image; ScanNet (https://github.com/ScanNet/ScanNet) and Stray Scanner
(https://github.com/strayrobots/scanner) have OpenCV axes. ScanNet's depth and color are assumed to be
registered: the offset between the two cameras, a few centimetres at most, is not applied. A .r3d file is a
ZIP archive of metadata (with dw, dh, the size of the depth), rgbd/0.jpg and rgbd/0.depth, float32 metres
compressed with LZFSE.
"""

import re
from dataclasses import replace
from pathlib import Path
from zipfile import ZipFile

import numpy as np

from digs_warp.checks import CaptureError, require_file, require_folder
from digs_warp.data.capture import FRAME_RATE
from digs_warp.data.images import MM_PER_METRE, image_size, write_image
from digs_warp.data.viewpoints import spread
from digs_warp.formats.captures.recording import (
    DEPTH_SUFFIXES,
    IMAGE_SUFFIXES,
    DepthCamera,
    NumberedFiles,
    RecordedFrame,
    Recording,
    expecting,
    known_pose,
    numbered_files,
    placed,
    read_numbers,
)
from digs_warp.formats.captures.video import chosen_frames
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL
from digs_warp.record.arrays import UNREADABLE, check_archive
from digs_warp.record.fields import ABOVE_ZERO, Fields, parse_json
from digs_warp.record.files import read_json, read_text, to_json, write_atomically

METADATA = "metadata.json"


def read_record3d(folder: Path) -> Recording:
    """Read an export "EXR + RGB" of Record3D."""
    base = "EXR_RGBD/" if (folder / "EXR_RGBD").is_dir() else ""
    files = NumberedFiles.find(folder, f"{base}rgb/", f"{base}depth/")
    path = folder / METADATA if (folder / METADATA).is_file() else folder / base / METADATA
    metadata = Fields(read_json(path, "metadata"), f"'{path}'", CaptureError)
    cameras = _cameras(metadata, files)
    rows = metadata.array("poses", (-1, 7), default=np.zeros((0, 7)), finite=False)
    found = {i: placed(row[:4], row[4:]) for i, row in enumerate(rows)}
    poses = {i: pose @ OPENCV_FROM_OPENGL for i, pose in found.items() if pose is not None}
    rate = metadata.number("fps", 0, default=0.0) or FRAME_RATE
    return files.recording(cameras, poses, frame_rate=rate)


def read_r3d(path: Path, scratch: Path, count: int) -> Recording:
    """Unpack evenly spread frames of a file of Record3D to ``scratch``, and return them.

    Args:
        path: the file.
        scratch: a folder that has to live as long as the recording.
        count: the most frames to take.
    """
    require_file(path, "recording of Record3D", "Name a .r3d file, or the folder of an export.")
    try:
        import liblzfse  # pyright: ignore[reportMissingImports]
    except ModuleNotFoundError as error:
        raise CaptureError(
            f"'{path}': depth in .r3d needs pyliblzfse: pip install 'digs-warp[record3d]'; or export it in "
            "the app as EXR + RGB"
        ) from error
    expected = "expected a .r3d file as Record3D shares it"
    check_archive(path, "recording", expected)
    try:
        with ZipFile(path) as archive:
            metadata = parse_json(archive.read("metadata"))
            size = int(metadata["dh"]), int(metadata["dw"])
            numbers = sorted(
                int(name[5:-4])
                for name in archive.namelist()
                if re.fullmatch(r"rgbd/\d+\.jpg", name)
            )
            for number in spread(len(numbers), count):
                name = numbers[number]
                image = archive.read(f"rgbd/{name}.jpg")
                write_atomically(scratch / f"rgb/{name}.jpg", image)
                depth = liblzfse.decompress(archive.read(f"rgbd/{name}.depth"))
                values = np.frombuffer(depth, "<f4").reshape(size)
                write_image(scratch / f"depth/{name}.exr", values)
    except (*UNREADABLE, liblzfse.error) as error:
        raise CaptureError(f"'{path}': {error}; {expected}") from error
    write_atomically(scratch / METADATA, to_json(metadata).encode())
    return replace(read_record3d(scratch), folder=path)


def _cameras(metadata: Fields, files: NumberedFiles) -> dict[int, Intrinsics]:
    """Return the camera of each image; the phone may have written one for each (autofocus)."""
    size = files.image_size
    written = metadata.number("w", 1, default=size[0]), metadata.number("h", 1, default=size[1])
    if (written[0] > written[1]) != (
        size[0] > size[1]
    ):  # a phone turns its images, not always these
        written = written[::-1]
    scale = size[0] / written[0]
    k = Intrinsics.from_matrix(metadata.array("K", (3, 3)).T, *size)
    shared = np.array([k.fx, k.fy, k.cx, k.cy])
    own = dict(
        enumerate(metadata.array("perFrameIntrinsicCoeffs", (-1, 4), default=np.zeros((0, 4))))
    )
    return {
        number: Intrinsics(*size, *_turned(own.get(number, shared) * scale, size))
        for number in files.images
    }


def _turned(row: np.ndarray, size: tuple[int, int]) -> list[float]:
    """Return fx, fy, cx, cy; exchanged if only then the principal point is near the middle of the image."""
    far, near = (np.abs(row[order] / size - 0.5).max() for order in ([2, 3], [3, 2]))
    return (row if far <= max(near, 0.1) else row[[1, 0, 3, 2]]).tolist()


def read_scannet(folder: Path) -> Recording:
    """Read a scene exported by ScanNet's SensReader, or another folder with the same layout."""
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
    """Read left images and depth as the ZED SDK's export samples write them."""
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


# (x, y, z) with y up -> (z, x, y).
_Z_UP = np.eye(4)[[2, 0, 1, 3]]
# The names of Polycam's files are times in microseconds.
_PER_SECOND = 1e6


def read_polycam(folder: Path) -> Recording:
    """Read raw data of Polycam."""
    corrected = numbered_files(folder, "keyframes/corrected_images/", IMAGE_SUFFIXES)
    prefix = "corrected_" if corrected else ""
    files = NumberedFiles.find(folder, f"keyframes/{prefix}images/", "keyframes/depth/")
    cameras, poses = {}, {}
    for number, image in files.images.items():
        path = folder / f"keyframes/{prefix}cameras/{image.stem}.json"
        camera = Fields(read_json(path, "camera"), f"'{path}'", CaptureError)
        size = camera.whole("width", 1), camera.whole("height", 1)
        fx, fy = (camera.number(key, ABOVE_ZERO, what="pixels above 0") for key in ("fx", "fy"))
        cameras[number] = Intrinsics(*size, fx, fy, camera.number("cx"), camera.number("cy"))
        rows = [[camera.number(f"t_{row}{column}") for column in range(4)] for row in range(3)]
        pose = known_pose(np.array([*rows, [0, 0, 0, 1]]))
        poses[number] = None if pose is None else _Z_UP @ pose @ OPENCV_FROM_OPENGL
    return files.recording(cameras, poses, frame_rate=_PER_SECOND)


def read_stray(folder: Path, scratch: Path, count: int) -> Recording:
    """Write the chosen frames of the film to ``scratch``, and return them with their depth and poses.

    Args:
        folder: of Stray Scanner.
        scratch: a folder that has to live as long as the recording.
        count: the most frames to take.
    """
    require_folder(folder, "recording", "Name the folder with rgb.mp4, odometry.csv and depth/.")
    path = folder / "odometry.csv"
    lines = [line for line in read_text(path, "odometry").splitlines() if line[:1].isdigit()]
    with expecting(f"'{path}'", "timestamp, frame, x, y, z, qx, qy, qz, qw in each line"):
        rows = np.array([[float(word) for word in line.split(",")[:9]] for line in lines])
        row_of = {int(row[1]): row for row in rows.reshape(-1, 9)}
    length = max(row_of, default=-1) + 1
    images, size, _ = chosen_frames(folder / "rgb.mp4", scratch, count, length)
    depths = numbered_files(folder, "depth/", DEPTH_SUFFIXES)
    matrix = read_numbers(folder / "camera_matrix.csv", (3, 3), "camera")
    k = Intrinsics.from_matrix(matrix, *size, first_center=0)
    frames = tuple(
        RecordedFrame(
            image=image,
            intrinsics=k,
            time=float(row[0]),
            world_from_cam=placed(row[5:], row[2:5]),
            depth=depths.get(number),
        )
        for number, image in images.items()
        if (row := row_of.get(number)) is not None
    )
    return Recording(folder, frames).with_unread("stray")
