"""The precision of stereo depth: an extension of the paper (its eq. 10 weights all measurements equally).

Depth is z = f b / disparity, so a disparity with standard deviation s_d [px] makes

    sigma_z = z^2 s_d / (f b),

(Gallup et al. 2008, "Variable baseline/resolution stereo", eq. 3). The best weights for a mean of
measurements of different precision are 1 / sigma_z^2; within one recording only z varies.
"""

import numpy as np

from digs_warp.geometry.camera import Camera, pixel_centers


def depth_deviation(depth: np.ndarray, disparity_noise: float, focal_baseline: float) -> np.ndarray:
    """Return sigma_z [m] of planar depths [m], any shape; NaN stays NaN.

    Args:
        depth: planar depth [m].
        disparity_noise: standard deviation of the disparity [px].
        focal_baseline: focal length [px] times baseline [m].
    """
    return depth**2 * (disparity_noise / focal_baseline)


def stereo_weights(depth: np.ndarray) -> np.ndarray:
    """Return weights proportional to 1 / sigma_z^2 of depths [m], any shape, float32: 1 at one metre.

    Where the depth is unknown the weight is 0.
    """
    with np.errstate(divide="ignore"):
        return np.nan_to_num(depth.astype(np.float32) ** np.float32(-4), nan=0.0)


def pixel_rays(camera: Camera) -> np.ndarray:
    """Return world directions per metre of planar depth, shape (height, width, 3), float64."""
    k = camera.intrinsics
    px = pixel_centers(k.width, k.height)
    directions = camera.unproject(px, np.ones((k.height, k.width)))
    return directions - camera.center_world
