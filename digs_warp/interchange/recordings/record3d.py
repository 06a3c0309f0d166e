"""Record3D (iPhone, iPad): metadata.json beside colour images and float EXR depth.

    metadata.json    K (9 numbers, column by column), w, h, fps,
                     poses (qx qy qz qw tx ty tz, world from camera)
    rgb/0.jpg        depth/0.exr in metres, at the depth sensor's own size    or both below EXR_RGBD/

See https://record3d.app/features. Cameras have OpenGL axes (ARKit); K counts pixels of the colour image.
"""

from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.camera import Intrinsics
from digs_warp.checks import CaptureError
from digs_warp.geometry import OPENCV_FROM_OPENGL, matrix_from_quat_xyzw, rigid
from digs_warp.interchange.recordings.files import (
    IMAGE_SUFFIXES,
    image_size,
    numbered_files,
    require_files,
)
from digs_warp.interchange.recordings.recording import RecordedFrame, Recording
from digs_warp.record.files import read_json


def read_record3d(folder: Path) -> Recording:
    """Read an export "EXR + RGB" of Record3D.

    Raises:
        CaptureError: no images or metadata, or metadata without a camera.
    """
    base = folder / "EXR_RGBD" if (folder / "EXR_RGBD").is_dir() else folder
    images = require_files(folder, numbered_files(base / "rgb", IMAGE_SUFFIXES), "rgb/*.jpg")
    depths = numbered_files(base / "depth", (".exr",))
    place = folder if (folder / "metadata.json").is_file() else base
    metadata = read_json(place / "metadata.json", "metadata")
    cameras = _intrinsics(metadata, image_size(next(iter(images.values()))), place, len(images))
    poses = _poses(metadata, place)
    rate = float(metadata.get("fps") or 30.0)
    return Recording(
        folder,
        tuple(
            RecordedFrame(
                image=image,
                intrinsics=cameras[order],
                time=number / rate,
                world_from_cam=poses[number] if number < len(poses) else None,
                depth=depths.get(number),
            )
            for order, (number, image) in enumerate(images.items())
        ),
    )


def _intrinsics(
    metadata: dict[str, Any], size: tuple[int, int], folder: Path, count: int
) -> list[Intrinsics]:
    """The camera of each image: of its own where the phone noted one for each (autofocus)."""
    try:
        own = metadata.get("perFrameIntrinsicCoeffs") or []
        if len(own) == count:
            return [Intrinsics(*size, *(float(value) for value in row)) for row in own]
        matrix = np.array(metadata["K"], dtype=np.float64).reshape(3, 3).T
        scale = size[0] / float(metadata.get("w", size[0]))
        values = np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]]) * scale
        return [Intrinsics(*size, *values.tolist())] * count
    except (KeyError, TypeError, ValueError) as error:
        raise CaptureError(
            f"'{folder / 'metadata.json'}': expected K with 9 numbers ({error!r})"
        ) from None


def _poses(metadata: dict[str, Any], folder: Path) -> list[np.ndarray]:
    try:
        rows = np.array(metadata.get("poses", []), dtype=np.float64).reshape(-1, 7)
    except ValueError as error:
        raise CaptureError(
            f"'{folder / 'metadata.json'}': poses are no lists of 7 numbers ({error})"
        ) from None
    turns = matrix_from_quat_xyzw(rows[:, :4])
    return [
        rigid(turn, row[4:]) @ OPENCV_FROM_OPENGL for turn, row in zip(turns, rows, strict=True)
    ]
