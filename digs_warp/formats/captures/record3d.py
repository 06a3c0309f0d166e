"""Record3D (iPhone, iPad): metadata.json beside color images and float EXR depth.

    metadata.json    K (9 numbers, column by column), w, h, fps,
                     poses (qx qy qz qw tx ty tz, world from camera)
    rgb/0.jpg        depth/0.exr in metres, at the size of the depth sensor     both may be below EXR_RGBD/

See https://record3d.app/features. Cameras have OpenGL axes (ARKit); K counts pixels of the color image.
"""

from pathlib import Path

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.formats.captures.recording import FRAME_RATE, NumberedFiles, Recording
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL, matrix_from_quat_xyzw, rigid
from digs_warp.record.fields import Fields
from digs_warp.record.files import read_json

METADATA = "metadata.json"


def read_record3d(folder: Path) -> Recording:
    """Read an export "EXR + RGB" of Record3D.

    Raises:
        CaptureError: no images or metadata, or metadata without a camera.
    """
    base = "EXR_RGBD/" if (folder / "EXR_RGBD").is_dir() else ""
    files = NumberedFiles.find(folder, f"{base}rgb/", f"{base}depth/", (".exr",))
    path = folder / METADATA if (folder / METADATA).is_file() else folder / base / METADATA
    metadata = Fields(read_json(path, "metadata"), f"'{path}'", CaptureError)
    cameras = _cameras(metadata, files)
    rows = metadata.array("poses", (-1, 7), default=np.zeros((0, 7)))
    turns = matrix_from_quat_xyzw(rows[:, :4])
    poses = {i: rigid(turns[i], rows[i, 4:]) @ OPENCV_FROM_OPENGL for i in range(len(rows))}
    rate = metadata.number("fps", 0, default=0.0) or FRAME_RATE
    return files.recording(cameras, poses, frame_rate=rate)


def _cameras(metadata: Fields, files: NumberedFiles) -> Intrinsics | dict[int, Intrinsics]:
    """The camera of all images, or one for each where the phone wrote them (autofocus)."""
    size = files.image_size
    own = metadata.array("perFrameIntrinsicCoeffs", (-1, 4), default=np.zeros((0, 4)))
    if len(own) == len(files.images):
        rows = zip(files.images, own.tolist(), strict=True)
        return {number: Intrinsics(*size, *row) for number, row in rows}
    matrix = metadata.array("K", (3, 3)).T
    scale = size[0] / metadata.number("w", 1, default=size[0])
    values = np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]]) * scale
    return Intrinsics(*size, *values.tolist())
