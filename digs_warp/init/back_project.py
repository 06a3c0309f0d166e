"""Pixels with depth -> coloured points in the world (paper section 3.3.1, eq. 8)."""

import numpy as np

from digs_warp.camera import Camera


def back_project(
    camera: Camera, image: np.ndarray, depth: np.ndarray, keep: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the points and colours of the kept pixels, row by row.

    Args:
        camera: the camera of the view; its size is that of the arrays.
        image: sRGB, shape (height, width, 3), uint8.
        depth: planar depth [m], shape (height, width); finite wherever ``keep`` is set.
        keep: which pixels to project, shape (height, width), bool.

    Returns:
        points_world [m], shape (n, 3), float64, and colours in 0..1, shape (n, 3), float64.
    """
    rows, columns = np.nonzero(keep)
    px = np.stack([columns + 0.5, rows + 0.5], axis=-1)
    points_world = camera.unproject(px, depth[rows, columns].astype(np.float64))
    return points_world, image[rows, columns] / 255.0
