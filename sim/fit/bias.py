"""Bias: disparity against the true one, offset and scale, from walls at known distances."""

from collections.abc import Sequence

import numpy as np

from digs_warp.sim.fit.depth_noise import Moments, residuals
from digs_warp.sim.fit.estimate import UNKNOWN, Estimate
from digs_warp.sim.fit.wall import Pose, Wall

# A line through fewer points has no scatter to tell its error from.
FEWEST_POSES = 3

# Distances differ enough for a scale if their disparities do by this factor.
LEVER = 1.3


def bias(wall: Wall, distances: Sequence[float] | None = None) -> tuple[Estimate, Estimate]:
    """Return offset [px] and scale of the disparity: measured = scale * true + offset.

    A straight line through the poses; its error follows from how far they lie off it.

    Args:
        wall: with true disparity, or with ``distances``.
        distances: depth of the wall on the optical axis at each pose, from the nearest to the farthest [m].
    """
    pairs = [_pair(wall, pose, distance) for pose, distance in _known(wall, distances)]
    if len(pairs) < FEWEST_POSES:
        return UNKNOWN, UNKNOWN
    true, measured = np.array(pairs).T
    if true.max() < LEVER * true.min():
        return UNKNOWN, UNKNOWN
    return fit_line(true, measured)


def fit_line(x: np.ndarray, y: np.ndarray) -> tuple[Estimate, Estimate]:
    """Return offset and slope of y = slope * x + offset by least squares; three points or more."""
    from scipy.stats import t

    center = x.mean()
    spread = np.sum((x - center) ** 2)
    slope = float(np.sum((x - center) * y) / spread)
    offset = float(y.mean() - slope * center)
    freedom = len(x) - 2
    scatter = np.sqrt(np.sum((y - slope * x - offset) ** 2) / freedom)
    # Few points underestimate their scatter now and then: as wide as the 95 % interval would be.
    scatter *= t.ppf(0.975, freedom) / 1.96
    return (
        Estimate(offset, float(scatter * np.sqrt(1 / len(x) + center**2 / spread))),
        Estimate(slope, float(scatter / np.sqrt(spread))),
    )


def _known(wall: Wall, distances: Sequence[float] | None) -> list[tuple[Pose, float | None]]:
    if distances is not None:
        return list(zip(wall.poses, distances, strict=True))
    return [(pose, None) for pose in wall.poses if pose.true is not None]


def _pair(wall: Wall, pose: Pose, distance: float | None) -> tuple[float, float]:
    """Return true and measured disparity of a pose [px]."""
    if distance is not None:
        return wall.focal_baseline / distance, wall.focal_baseline / wall.distance(pose)
    assert pose.true is not None
    measured = Moments(residuals(pose)).mean + pose.plane.disparity(wall.shape)
    known = np.isfinite(measured) & np.isfinite(pose.true)
    return float(pose.true[known].mean()), float(measured[known].mean())
