"""How fast the image moves when the camera moves."""

import numpy as np

from digs_warp.geometry.camera import Intrinsics


def image_motion(
    depth: np.ndarray,
    intrinsics: Intrinsics,
    velocity_cam: tuple[float, float, float],
    angular_velocity_cam: tuple[float, float, float],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the velocity (u, v) of the image of a static scene [px/s], each (height, width), float32.

    With the camera at velocity t and angular velocity w (its own axes), a point P = Z (x, y, 1) moves
    at -t - w x P in the camera; its image follows (Longuet-Higgins and Prazdny 1980, eq. 2).

    Args:
        depth: planar z [m], (height, width), at any resolution; NaN counts as infinitely far.
        intrinsics: of the camera.
        velocity_cam: [m/s].
        angular_velocity_cam: [rad/s].
    """
    k = intrinsics
    height, width = depth.shape
    x = ((np.arange(width, dtype=np.float32) + 0.5) * (k.width / width) - k.cx) / k.fx
    y = ((np.arange(height, dtype=np.float32) + 0.5) * (k.height / height) - k.cy) / k.fy
    y = y[:, None]
    tx, ty, tz = (np.float32(value) for value in velocity_cam)
    wx, wy, wz = (np.float32(value) for value in angular_velocity_cam)
    inverse = np.nan_to_num(1 / depth.astype(np.float32, copy=False), nan=0.0)
    u = k.fx * ((tz * x - tx) * inverse + wx * x * y - wy * (1 + x * x) + wz * y)
    v = k.fy * ((tz * y - ty) * inverse + wx * (1 + y * y) - wy * x * y - wz * x)
    return u, v
