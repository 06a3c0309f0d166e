"""Two clusters of depth: the foreground and the background (paper section 3.3.1, eq. 9).

Depth catches a mask that leaks onto the background (paper figure 6), because the background is far behind.
The paper clusters depth by k-means with two centroids and weights 1.0 and 3.0 in the assignment, without
details. Here:

- The centroids come from the best split of the sorted depths (the smallest sum of squared distances to the
  two means). In one dimension the best split is found exactly, without a start, iterations or a seed.
- A pixel is background where ``w_background |d - c_background| < w_foreground |d - c_foreground|``. With
  3.0 it has to be three times closer to the background's centroid, so that a deep object keeps its far
  side. Only the border between the centroids counts: everything beyond the background's is background.
  (With the weights inside Lloyd's iteration, the border in simulated rooms was the same to a centimetre.)
- The foreground is the cluster that holds most of the mask; it is not always the nearer one.
- The other cluster is background only if most of it lies outside the mask. Where no background was
  measured, both clusters are the object. If the mask covers the whole image, the nearer cluster is the
  foreground.

Depth noise moves the centroids by its mean, which is almost zero. It moves pixels across the border only if
a surface lies there. Noise grows with the square of the distance, and widens the background's cluster away
from the object.
"""

import numpy as np

# Pixels that vote on the centroids: a regular subset of large images is enough.
SAMPLE_PIXELS = 50_000
# Share of the votes dropped at either end, so that a few outliers do not become a cluster.
TRIMMED = 0.01
# w_background / w_foreground (paper section 4.1): 1 instead makes no difference, docs/research/studies.md.
BACKGROUND_WEIGHT = 3.0
# Where that puts the border, on the way from one centroid to the other.
BORDER = BACKGROUND_WEIGHT / (1.0 + BACKGROUND_WEIGHT)
# A mask that covers at least this share of the image carries no information.
FULL_MASK = 0.99


# From the nearest to the farthest depth that counts as foreground [m], both included.
DepthRange = tuple[np.float32, np.float32]
EVERYTHING: DepthRange = (np.float32(-np.inf), np.float32(np.inf))


def foreground_range(depth: np.ndarray, in_mask: np.ndarray) -> DepthRange:
    """Return the depths of the foreground cluster C_foreground.

    Args:
        depth: planar depth [m] of the whole view, shape (height, width), NaN where unknown.
        in_mask: the object according to the mask, shape (height, width), bool.
    """
    stride = int(np.ceil(np.sqrt(depth.size / SAMPLE_PIXELS)))
    depth, in_mask = depth[::stride, ::stride], in_mask[::stride, ::stride]
    known = ~np.isnan(depth)
    values, votes_mask = depth[known], in_mask[known]
    centers = two_means(np.sort(values))
    if centers is None:
        return EVERYTHING
    near, far = centers
    is_near = values < 0.5 * (near + far)
    near_in_mask, far_in_mask = (
        np.count_nonzero(votes_mask & side) for side in (is_near, ~is_near)
    )
    is_full = np.mean(in_mask) > FULL_MASK
    foreground_is_near = is_full or near_in_mask >= far_in_mask
    other, other_in_mask = (
        (~is_near, far_in_mask) if foreground_is_near else (is_near, near_in_mask)
    )
    if not is_full and other_in_mask > 0.5 * np.count_nonzero(other):
        return EVERYTHING
    if foreground_is_near:
        return EVERYTHING[0], np.float32(near + BORDER * (far - near))
    return np.float32(far + BORDER * (near - far)), EVERYTHING[1]


def two_means(ascending: np.ndarray) -> tuple[float, float] | None:
    """Return the means of the best two clusters of sorted values; None if all values are equal.

    The split after k of n values minimizes the summed squared distances to the two means, that is, it
    maximizes k (n - k) (m1 - m2)^2. One hundredth of the values is dropped at either end.
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
