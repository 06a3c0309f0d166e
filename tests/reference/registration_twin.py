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
    for v in range(height):
        for u in range(width):
            z = float(depth[v, u])
            if not (np.isfinite(z) and z > 0):
                continue
            corners = []
            for x, y in ((u, v), (u + 1, v + 1)):
                point = np.array([(x - k.cx) / k.fx * z, (y - k.cy) / k.fy * z, z])
                point[0] -= rig.color_offset
                corners.append((c.fx * point[0] / z + c.cx, c.fy * point[1] / z + c.cy))
            (left, top), (right, bottom) = corners
            for row in range(height):
                for column in range(width):
                    across = min(right, column + 1) - max(left, column)
                    down = min(bottom, row + 1) - max(top, row)
                    if across > 1e-6 and down > 1e-6:
                        found[row, column] = min(found[row, column], z)
    return np.where(np.isfinite(found), found, np.nan).astype(np.float32)
