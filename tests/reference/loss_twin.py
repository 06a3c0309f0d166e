"""Float64 twins of the loss terms, straight from their formulas."""

import numpy as np

from digs_warp.measure.metrics import ssim_map


def photometric(
    image: np.ndarray, target: np.ndarray, weights: np.ndarray, dssim_weight: float
) -> float:
    """Mean over all pixels and channels of w ((1 - lambda) |x - y| + lambda (1 - SSIM))."""
    image, target = image.astype(np.float64), target.astype(np.float64)
    terms = (1 - dssim_weight) * np.abs(image - target)
    terms = terms + dssim_weight * (1 - ssim_map(image, target))
    return float((weights[..., None] * terms).mean())


def depth(
    rendered: np.ndarray,
    measured: np.ndarray,
    weights: np.ndarray,
    alpha: np.ndarray,
    bias: float = 0.0,
) -> float:
    """Weighted mean of log(1 + |z - d| / (0.01 d)), d without its bias; uncovered pixels add nothing."""
    total = 0.0
    measured = 1.0 / (1.0 / measured.astype(np.float64) - bias)
    for z, d, w, a in zip(rendered.flat, measured.flat, weights.flat, alpha.flat, strict=True):
        if w > 0 and a >= 0.5:
            total += w * np.log1p(abs(float(z) - float(d)) / (0.01 * float(d)))
    return total / float(weights.sum())
