"""Float64 twin of the filter in 3D: s_eff^2 = s^2 + c p^2, p the finest pixel at a splat."""

from collections.abc import Sequence

import numpy as np

from digs_warp.geometry.camera import Camera


def sampling_distances_twin(
    means: np.ndarray, cameras: Sequence[Camera], nears: Sequence[float]
) -> np.ndarray:
    """Return the size of a pixel [m] of the finest view, else of the nearest camera, (n,)."""
    finest, nearest = np.full((2, len(means)), np.inf)
    for camera, near in zip(cameras, nears, strict=True):
        k = camera.intrinsics
        focal = max(k.fx, k.fy)
        away = means.astype(np.float64) - camera.center_world
        nearest = np.minimum(nearest, np.linalg.norm(away, axis=1) / focal)
        px, z = camera.project(means.astype(np.float64))
        seen = (z > near) & (px >= 0).all(axis=1) & (px <= [k.width, k.height]).all(axis=1)
        finest = np.where(seen, np.minimum(finest, z / focal), finest)
    return np.where(np.isfinite(finest), finest, nearest)


def effective_twin(log_scales: np.ndarray, distances: np.ndarray, share: float) -> np.ndarray:
    """Return ln s_eff of learned ln s, (n, 3); ``share``: c."""
    variances = np.exp(2.0 * log_scales.astype(np.float64))
    return 0.5 * np.log(variances + share * np.square(distances)[:, None])
