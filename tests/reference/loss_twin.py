"""Float64 twin of the depth term, straight from its formula."""

import numpy as np


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
