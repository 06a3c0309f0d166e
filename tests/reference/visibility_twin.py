"""What each view says about each point, in plain NumPy."""

from collections.abc import Sequence

import numpy as np

from digs_warp.geometry.camera import Camera


def agreement_by(
    points_world: np.ndarray, views: Sequence[tuple[Camera, np.ndarray]], voxel_size: float
) -> np.ndarray:
    """Return the share of the views that measured the surface near a point and agree with it, (n,)."""
    measured, own = _compared(points_world, views)
    agreeing, near = (
        (np.abs(measured - own) <= limit * voxel_size).sum(axis=0) for limit in (1, 4)
    )
    return np.where(near > 0, agreeing / np.maximum(near, 1), 1.0)


def said_by(
    points_world: np.ndarray, views: Sequence[tuple[Camera, np.ndarray]], voxel_size: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return how many views confirm, contradict and cannot see each point, (n,) each."""
    measured, own = _compared(points_world, views)
    beyond = (measured - own) / (2 * voxel_size + 0.01 * measured)
    said = np.abs(beyond) <= 1, beyond > 1, np.isnan(own) | (beyond < -1)
    return said[0].sum(axis=0), said[1].sum(axis=0), said[2].sum(axis=0)


def _compared(
    points_world: np.ndarray, views: Sequence[tuple[Camera, np.ndarray]]
) -> tuple[np.ndarray, np.ndarray]:
    """Return what each view measured at each point, and its depth there; NaN outside, (views, n) each."""
    found = np.full((2, len(views), len(points_world)), np.nan)
    for i, (camera, depth) in enumerate(views):
        height, width = depth.shape
        px, z = camera.resized(width, height).project(points_world)
        seen = (z > 0) & (px >= 0).all(axis=1) & (px < [width, height]).all(axis=1)
        columns, rows = px[seen].astype(int).T
        found[0, i, seen], found[1, i, seen] = depth[rows, columns], z[seen]
    return found[0], found[1]
