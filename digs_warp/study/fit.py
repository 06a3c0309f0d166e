"""Laws that are sums of costs, fitted to measurements."""

import numpy as np


def fit_nonnegative(counts: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fit values as a sum of counts times costs, none below zero, with the smallest relative error.

    Args:
        counts: shape (measurements, terms).
        values: what was measured, above 0, shape (measurements,).

    Returns:
        The cost of each term, and the relative error of each measurement.
    """
    from scipy.optimize import nnls

    # Columns of one size: counts of pixels and of frames differ by a factor of millions.
    relative = counts / values[:, None]
    size = np.linalg.norm(relative, axis=0)
    found, _ = nnls(relative / size, np.ones(len(values)))
    costs = found / size
    return costs, np.abs(counts @ costs / values - 1)
