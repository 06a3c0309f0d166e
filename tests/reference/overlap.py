"""How much two masks overlap."""

import numpy as np

from digs_warp.checks import check_shape


def intersection_over_union(mask: np.ndarray, truth: np.ndarray, threshold: int = 127) -> float:
    """Return the share of pixels in both masks among those in either, 0 to 1; two empty masks agree fully.

    Args:
        mask: shape (height, width), uint8.
        truth: of the same shape.
        threshold: values above it are object.
    """
    check_shape("mask", mask, truth.shape)
    a, b = mask > threshold, truth > threshold
    either = np.count_nonzero(a | b)
    return np.count_nonzero(a & b) / either if either else 1.0
