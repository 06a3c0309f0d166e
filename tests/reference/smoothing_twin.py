"""Float64 twin of the filter in 3D: s_eff^2 = s^2 + c p^2, p the finest pixel at a splat."""

from collections.abc import Sequence

import numpy as np

from digs_warp.geometry.camera import Camera


def sampling_distances_twin(
    means: np.ndarray, cameras: Sequence[Camera], nears: Sequence[float]
) -> np.ndarray:
    """Return the size of a pixel [m] of the finest view, else of the nearest camera, (n,)."""
    finest = np.full(len(means), np.inf)
    nearest = np.full(len(means), np.inf)
    for camera, near in zip(cameras, nears, strict=True):
        k = camera.intrinsics
        focal = max(k.fx, k.fy)
        for i, mean in enumerate(means.astype(np.float64)):
            x, y, z = camera.cam_from_world[:3, :3] @ mean + camera.cam_from_world[:3, 3]
            nearest[i] = min(nearest[i], np.sqrt(x * x + y * y + z * z) / focal)
            if z <= near:
                continue
            u, v = k.fx * x / z + k.cx, k.fy * y / z + k.cy
            if 0 <= u <= k.width and 0 <= v <= k.height:
                finest[i] = min(finest[i], z / focal)
    return np.where(np.isfinite(finest), finest, nearest)


def effective_twin(log_scales: np.ndarray, distances: np.ndarray, share: float) -> np.ndarray:
    """Return ln s_eff of learned ln s, (n, 3); ``share``: c."""
    variances = np.exp(2.0 * log_scales.astype(np.float64))
    return 0.5 * np.log(variances + share * np.square(distances)[:, None])
