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
    measured = 1.0 / (1.0 / measured.astype(np.float64) - bias)
    terms = weights * np.log1p(np.abs(rendered - measured) / (0.01 * measured))
    return float(terms[alpha >= 0.5].sum() / weights.sum())
