"""Two clusters of depth: the foreground and the background (paper section 3.3.1, eq. 9).

Depth catches a mask that leaks onto the background (paper figure 6), because the background is far behind.
The paper clusters depth by k-means with two centroids and weights 1.0 and 3.0 in the assignment, without
details. Here the centroids come from the best split of the sorted depths, which is found exactly. A pixel is
background where ``3 |d - c_background| < |d - c_foreground|``: three times closer to its centroid, so that a
deep object keeps its far side; and beyond the centroid of the background in any case.

The foreground is the cluster that holds most of the mask; it is not always the nearer one. The other one is
background only if most of it lies outside the mask: where no background was measured, both are the object.
"""

import numpy as np

# Pixels that vote on the centroids: a regular subset of large images is enough.
SAMPLE_PIXELS = 50_000
# Share of the votes dropped at either end, so that a few outliers do not become a cluster.
TRIMMED = 0.01
# Where the weights (paper section 4.1) put the border, on the way from one centroid to the other.
BORDER = 3.0 / (1.0 + 3.0)
# A mask that covers at least this share of the image tells nothing: the nearer cluster is the foreground.
FULL_MASK = 0.99

EVERYTHING = (np.float32(-np.inf), np.float32(np.inf))


def foreground_range(depth: np.ndarray, in_mask: np.ndarray) -> tuple[np.float32, np.float32]:
    """Return the depths of the foreground cluster C_foreground [m], from the nearest to the farthest.

    Args:
        depth: planar depth [m] of the whole view, shape (height, width), NaN where unknown.
        in_mask: the object according to the mask, shape (height, width), bool.
    """
    stride = int(np.ceil(np.sqrt(depth.size / SAMPLE_PIXELS)))
    depth, in_mask = depth[::stride, ::stride], in_mask[::stride, ::stride]
    known = ~np.isnan(depth)
    values, votes = depth[known], in_mask[known]
    centers = two_means(np.sort(values))
    if centers is None:
        return EVERYTHING
    is_near = values < 0.5 * sum(centers)
    is_full = np.mean(in_mask) > FULL_MASK
    nearer_in_mask = np.count_nonzero(votes & is_near) >= np.count_nonzero(votes & ~is_near)
    own, other, beyond = (
        (*centers, ~is_near) if is_full or nearer_in_mask else (*centers[::-1], is_near)
    )
    if not is_full and np.mean(votes[beyond]) > 0.5:
        return EVERYTHING
    border = np.float32(own + BORDER * (other - own))
    return (EVERYTHING[0], border) if own < other else (border, EVERYTHING[1])


def two_means(ascending: np.ndarray) -> tuple[float, float] | None:
    """Return the means of the best two clusters of sorted values; None if all values are equal.

    The split after k of n values minimizes the summed squared distances to the two means, that is, it
    maximizes k (n - k) (m1 - m2)^2.
    """
    trim = int(TRIMMED * len(ascending))
    values = ascending[trim : len(ascending) - trim].astype(np.float64)
    count = len(values)
    if count < 2 or values[0] == values[-1]:
        return None
    below = np.arange(1, count)
    sums = np.cumsum(values)
    lower = sums[:-1] / below
    upper = (sums[-1] - sums[:-1]) / (count - below)
    best = int(np.argmax(below * (count - below) * (upper - lower) ** 2))
    return float(lower[best]), float(upper[best])
