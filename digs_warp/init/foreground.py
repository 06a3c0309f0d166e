"""Two clusters of depth: what stands in front, and the background (paper section 3.3.1, eq. 9).

A mask that leaks onto the background (paper figure 6) is caught by depth: the background lies far behind.
The paper clusters depth by k-means with two centroids and weights 1.0 and 3.0 in the assignment, and
leaves open how. Here:

- The centroids are those of the best split of the sorted depths (the smallest sum of squared distances to
  the two means). In one dimension that is found exactly; no start, no iteration, no random seed.
- A pixel is background where ``w_background |d - c_background| < w_foreground |d - c_foreground|``: with
  3.0 it has to be three times as near to the background's centroid, so that a deep object keeps its far
  side. Only the border between the centroids counts: beyond the background's, all is background.
  (Weights inside the iteration, Lloyd's way, gave the same border on simulated rooms to a centimetre.)
- The foreground is the cluster that holds most of the mask; it need not be the nearer one.
- The other cluster is only background if it mostly lies outside the mask. Where no background was
  measured, both are the object. A mask that covers the whole image cannot tell, and the nearer cluster is
  taken.

Depth noise moves the centroids by its mean, which is next to nothing, and pixels across the border only
where a surface lies there. Far noise grows with the square of the distance and widens the background's
cluster away from the object.
"""

from dataclasses import dataclass

import numpy as np

# Pixels that vote on the centroids: a regular subset of large images is enough.
SAMPLE_PIXELS = 50_000
# Share of the votes left out at either end: single wild values must not make a cluster of their own.
TRIMMED = 0.01
# From this share of the image on a mask tells nothing.
FULL_MASK = 0.99


@dataclass(frozen=True)
class DepthRange:
    """Depths that count as foreground [m], both ends included."""

    near: float = -np.inf
    far: float = np.inf

    def contains(self, depth: np.ndarray) -> np.ndarray:
        """Return which depths lie in the range; NaN does not."""
        if np.isinf(self.near) and np.isinf(self.far):
            return ~np.isnan(depth)
        return (depth >= np.float32(self.near)) & (depth <= np.float32(self.far))


EVERYTHING = DepthRange()


def foreground_range(
    depth: np.ndarray, in_mask: np.ndarray, background_weight: float = 3.0
) -> DepthRange:
    """Return the depths of the foreground cluster C_foreground.

    Args:
        depth: planar depth [m] of the whole view, shape (height, width), NaN where unknown.
        in_mask: the object according to the mask, shape (height, width), bool.
        background_weight: w_background / w_foreground, 1 or more.
    """
    stride = int(np.ceil(np.sqrt(depth.size / SAMPLE_PIXELS)))
    depth, in_mask = depth[::stride, ::stride], in_mask[::stride, ::stride]
    known = ~np.isnan(depth)
    values, votes_mask = depth[known], in_mask[known]
    centers = two_means(np.sort(values))
    if centers is None:
        return EVERYTHING
    near_center, far_center = centers
    if np.mean(in_mask) > FULL_MASK:
        return _up_to_border(near_center, far_center, background_weight)
    is_near = values < 0.5 * (near_center + far_center)
    near_in_mask = np.count_nonzero(votes_mask & is_near)
    far_in_mask = np.count_nonzero(votes_mask & ~is_near)
    if near_in_mask >= far_in_mask:
        if far_in_mask > 0.5 * np.count_nonzero(~is_near):
            return EVERYTHING
        return _up_to_border(near_center, far_center, background_weight)
    if near_in_mask > 0.5 * np.count_nonzero(is_near):
        return EVERYTHING
    share = background_weight / (1.0 + background_weight)
    return DepthRange(near=far_center + share * (near_center - far_center))


def two_means(ascending: np.ndarray) -> tuple[float, float] | None:
    """Return the means of the best two clusters of sorted values; None where all are one value.

    The split after k of n values minimizes the summed squared distances to the two means, that is, it
    maximizes k (n - k) (m1 - m2)^2. One hundredth of the values is left out at either end.
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


def _up_to_border(near_center: float, far_center: float, background_weight: float) -> DepthRange:
    share = background_weight / (1.0 + background_weight)
    return DepthRange(far=near_center + share * (far_center - near_center))
