"""The depth that the camera measured, as colored points."""

from collections.abc import Iterator, Sequence

import numpy as np

from digs_warp.data.evenly import evenly
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import pixel_centers

NAME = "sensed depth"

# Frames and points of a cloud: a browser draws some hundred thousand points smoothly.
FRAMES, POINTS = 24, 200_000


def sensed_points(frames: Sequence[Frame]) -> dict[str, PointCloud]:
    """Return the cloud by its name; empty where no frame has depth.

    Depth is shown as it was measured, also around the object and where it is wrong.

    Raises:
        CaptureError: an image cannot be read, or is not of the camera's size.
    """
    with_depth = evenly([frame for frame in frames if frame.has(Layer.DEPTH)], FRAMES)
    clouds = list(_clouds(with_depth))
    return {NAME: PointCloud.joined(clouds)} if clouds else {}


def _clouds(frames: Sequence[Frame]) -> Iterator[PointCloud]:
    for frame in frames:
        depth = frame.load_depth()
        height, width = depth.shape
        step = max(1, round(np.sqrt(depth.size * len(frames) / POINTS)))
        chosen = np.zeros(depth.shape, dtype=bool)
        chosen[step // 2 :: step, step // 2 :: step] = True
        chosen &= np.isfinite(depth) & (depth > 0)
        camera = frame.camera.resized(width, height)
        pixels = pixel_centers(width, height)[chosen]
        points = camera.unproject(pixels, depth[chosen].astype(np.float64))
        yield PointCloud(points, _colors_at(frame.load_image(), pixels / [width, height]))


def _colors_at(photo: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the colors in 0..1 at places in 0..1 of the image, shape (n, 3)."""
    height, width = photo.shape[:2]
    columns, rows = (places * [width, height]).astype(np.int64).T
    return photo[rows, columns].astype(np.float32) / 255.0
