"""ScanNet: numbered files in color, depth, pose and intrinsic.

    color/0.jpg  depth/0.png        depth in millimetres, any size
    pose/0.txt                      4 x 4, world from camera, OpenCV axes; -inf where tracking was lost
    intrinsic/intrinsic_color.txt   intrinsic/intrinsic_depth.txt     4 x 4

See https://github.com/ScanNet/ScanNet. Depth and color are assumed to be registered: the offset between the
two cameras, a few centimetres at most, is not applied.
"""

from pathlib import Path

import numpy as np

from digs_warp.data.images import image_size
from digs_warp.formats.captures.recorded_files import (
    integer_centered_camera,
    numbered_files,
    read_numbers,
)
from digs_warp.formats.captures.recording import DepthCamera, NumberedFiles, Recording


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
        depth_camera = DepthCamera(integer_centered_camera(depth_k, size))
    poses = numbered_files(folder, "pose/", (".txt",))
    return files.recording(
        integer_centered_camera(color_k, files.image_size),
        {number: _read_pose(path) for number, path in poses.items()},
        depth_camera=depth_camera,
    )


def _read_pose(path: Path) -> np.ndarray | None:
    pose = read_numbers(path, (4, 4), "pose")
    return pose if np.isfinite(pose).all() else None
