"""What each view says about each point, in plain NumPy."""

from collections.abc import Sequence

import numpy as np

from digs_warp.geometry.camera import Camera


def agreement_by(
    points_world: np.ndarray, views: Sequence[tuple[Camera, np.ndarray]], voxel_size: float
) -> np.ndarray:
    """Return the share of the views that measured the surface near a point and agree with it, (n,)."""
    agreeing, near = np.zeros((2, len(points_world)), dtype=np.int64)
    for camera, depth in views:
        height, width = depth.shape
        px, z = camera.resized(width, height).project(points_world)
        for i, ((u, v), own) in enumerate(zip(px, z, strict=True)):
            if own > 0 and 0 <= u < width and 0 <= v < height:
                apart = abs(float(depth[int(v), int(u)]) - own)
                agreeing[i] += apart <= 1 * voxel_size
                near[i] += apart <= 4 * voxel_size
    return np.where(near > 0, agreeing / np.maximum(near, 1), 1.0)


def said_by(
    points_world: np.ndarray, views: Sequence[tuple[Camera, np.ndarray]], voxel_size: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return how many views confirm, contradict and cannot see each point, (n,) each."""
    confirmed, contradicted, blind = np.zeros((3, len(points_world)), dtype=np.int64)
    for camera, depth in views:
        height, width = depth.shape
        px, z = camera.resized(width, height).project(points_world)
        for i, ((u, v), own) in enumerate(zip(px, z, strict=True)):
            if not (own > 0 and 0 <= u < width and 0 <= v < height):
                blind[i] += 1
                continue
            measured = float(depth[int(v), int(u)])
            tolerance = 2 * voxel_size + 0.01 * measured
            confirmed[i] += abs(measured - own) <= tolerance
            contradicted[i] += measured - own > tolerance
            blind[i] += own - measured > tolerance
    return confirmed, contradicted, blind
