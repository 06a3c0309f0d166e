"""ScanNet-style: numbered files in color, depth, pose and intrinsic.

    color/0.jpg  depth/0.png        depth in millimetres, at its own size
    pose/0.txt                      4 x 4, world from camera, OpenCV axes; -inf where tracking was lost
    intrinsic/intrinsic_color.txt   intrinsic/intrinsic_depth.txt     4 x 4

See https://github.com/ScanNet/ScanNet. Depth and colour are taken to be registered (the offset of the two
cameras, some centimetres at most, is not applied).
"""

from pathlib import Path

import numpy as np

from digs_warp.interchange.recordings.files import (
    IMAGE_SUFFIXES,
    image_size,
    intrinsics_of_matrix,
    numbered_files,
    read_numbers,
    require_files,
)
from digs_warp.interchange.recordings.recording import Recording, numbered_frames

DEPTH_UNITS_PER_METRE = 1000.0


def read_scannet(folder: Path) -> Recording:
    """Read a scene exported by ScanNet's SensReader, or anything laid out like it.

    Raises:
        CaptureError: no images, or broken matrices.
    """
    images = require_files(folder, numbered_files(folder / "color", IMAGE_SUFFIXES), "color/*.jpg")
    depths = numbered_files(folder / "depth", (".png",))
    poses = numbered_files(folder / "pose", (".txt",))
    color_k = read_numbers(folder / "intrinsic/intrinsic_color.txt", (4, 4), "camera")
    k = intrinsics_of_matrix(color_k, image_size(next(iter(images.values()))), integer_centers=True)
    depth_camera = None
    if depths:
        depth_k = read_numbers(folder / "intrinsic/intrinsic_depth.txt", (4, 4), "depth camera")
        size = image_size(next(iter(depths.values())))
        depth_camera = intrinsics_of_matrix(depth_k, size, integer_centers=True)
    frames = numbered_frames(
        images,
        k,
        world_from_cam={number: _read_pose(path) for number, path in poses.items()},
        depth=depths,
        depth_units_per_metre=dict.fromkeys(images, DEPTH_UNITS_PER_METRE),
    )
    return Recording(folder, frames, depth_camera=depth_camera)


def _read_pose(path: Path) -> np.ndarray | None:
    pose = read_numbers(path, (4, 4), "pose")
    return pose if np.isfinite(pose).all() else None
