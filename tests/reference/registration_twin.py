"""Registration of depth to a color camera in float64, pixel by pixel, from points and rectangles."""

import numpy as np

from digs_warp.sim.camera.rig import StereoRig


def register(depth: np.ndarray, rig: StereoRig) -> np.ndarray:
    """Return the depth [m] that each color pixel gets, (height, width), NaN where none.

    The corners of each depth pixel become points at its depth. The color camera is moved by the offset and
    has its own focal length; all of its pixels that overlap the rectangle get the depth, the nearest wins.
    """
    k, c = rig.intrinsics, rig.image_intrinsics
    height, width = depth.shape
    found = np.full(depth.shape, np.inf)
    rows, columns = np.arange(height), np.arange(width)
    for (v, u), z in np.ndenumerate(depth.astype(np.float64)):
        if not (np.isfinite(z) and z > 0):
            continue
        x = (np.array([u, u + 1]) - k.cx) / k.fx * z - rig.color_offset
        y = (np.array([v, v + 1]) - k.cy) / k.fy * z
        (left, right), (top, bottom) = c.fx * x / z + c.cx, c.fy * y / z + c.cy
        across = np.minimum(right, columns + 1) - np.maximum(left, columns) > 1e-6
        down = np.minimum(bottom, rows + 1) - np.maximum(top, rows) > 1e-6
        found[np.ix_(down, across)] = np.minimum(found[np.ix_(down, across)], z)
    return np.where(np.isfinite(found), found, np.nan).astype(np.float32)
