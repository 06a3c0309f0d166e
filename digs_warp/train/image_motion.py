"""How fast the image of an object moves while its camera does."""

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.geometry.rigid import transform_points

# Points of the object that tell how far its image moves.
POINTS = 200


def some_of(points: np.ndarray) -> np.ndarray:
    """Return at most about `POINTS` of the points, shape (n, 3), evenly spread over their order."""
    return points[:: max(1, len(points) // POINTS)]


def image_speed(frame: Frame, points: np.ndarray) -> np.ndarray:
    """Return how fast points before the camera move on the image [px/s], shape (m,); none without a motion.

    Args:
        frame: its camera, and the motion of that.
        points: in the world, shape (n, 3).
    """
    motion = frame.exposure.motion
    if motion is None:
        return np.zeros(0)
    seen = transform_points(frame.camera.cam_from_world, points.astype(np.float64))
    x, y, z = seen[seen[:, 2] > 0].T
    moving = (
        -np.array(motion.velocity)[:, None]
        - np.cross(np.array(motion.angular_velocity), np.stack([x, y, z], axis=1)).T
    )
    k = frame.camera.intrinsics
    u = k.fx * (moving[0] - x / z * moving[2]) / z
    v = k.fy * (moving[1] - y / z * moving[2]) / z
    return np.hypot(u, v)
