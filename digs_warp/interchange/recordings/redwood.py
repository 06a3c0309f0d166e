"""Redwood / Open3D: color, depth, camera and trajectory as `digs_warp.interchange.redwood` describes them."""

from pathlib import Path

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.interchange.recordings.files import (
    IMAGE_SUFFIXES,
    intrinsics_of_matrix,
    numbered_files,
    read_numbers,
    require_files,
)
from digs_warp.interchange.recordings.recording import Recording, numbered_frames
from digs_warp.interchange.redwood import DEPTH_UNITS_PER_METRE
from digs_warp.record.files import read_json


def read_redwood(folder: Path) -> Recording:
    """Read a data set of Open3D's reconstruction system; trajectory.log may be missing.

    Raises:
        CaptureError: no images or camera, or a trajectory that does not fit them.
    """
    images = require_files(folder, numbered_files(folder / "color", IMAGE_SUFFIXES), "color/*.png")
    depths = numbered_files(folder / "depth", (".png",))
    camera = read_json(folder / "camera_intrinsic.json", "camera")
    try:
        matrix = np.array(camera["intrinsic_matrix"], dtype=np.float64).reshape(3, 3).T
        size = (int(camera["width"]), int(camera["height"]))
    except (KeyError, TypeError, ValueError) as error:
        raise CaptureError(
            f"'{folder / 'camera_intrinsic.json'}': expected width, height and 9 numbers intrinsic_matrix "
            f"({error!r})"
        ) from None
    k = intrinsics_of_matrix(matrix, size, integer_centers=True)
    log = _read_log(folder / "trajectory.log")
    frames = numbered_frames(
        images,
        k,
        world_from_cam={number: log[i] for i, number in enumerate(images) if i in log},
        depth=depths,
        depth_units_per_metre=dict.fromkeys(images, DEPTH_UNITS_PER_METRE),
    )
    return Recording(folder, frames)


def _read_log(path: Path) -> dict[int, np.ndarray]:
    """Return the poses, world from camera, by frame; the middle number of an entry's head is the frame."""
    if not path.is_file():
        return {}
    numbers = read_numbers(path, (-1, 19), "trajectory")
    return {index: row[3:].reshape(4, 4) for index, row in enumerate(numbers)}
