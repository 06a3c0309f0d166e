"""The colors in which a photograph sees points, in plain NumPy."""

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer


def colors_seen(points_world: np.ndarray, frame: Frame) -> np.ndarray:
    """Return the mean sRGB color of 3x3 pixels around each point, (n, 3), NaN where it is not seen."""
    image = frame.load_image()
    mask = frame.load_mask() if frame.has(Layer.MASK) else np.full(image.shape[:2], 255, np.uint8)
    depth = frame.load_depth() if frame.has(Layer.DEPTH) else None
    height, width = image.shape[:2]
    found = np.full((len(points_world), 3), np.nan)
    for i, ((u, v), z) in enumerate(zip(*frame.camera.project(points_world), strict=True)):
        if not (z > 0 and 1 <= np.floor(u) < width - 1 and 1 <= np.floor(v) < height - 1):
            continue
        row, column = int(v), int(u)
        if depth is not None and not abs(float(depth[row, column]) - z) <= 0.015 * z:
            continue
        block = np.s_[row - 1 : row + 2, column - 1 : column + 2]
        if (mask[block] == 255).all():
            found[i] = (image[block].reshape(9, 3) / 255.0).mean(axis=0)
    return found
