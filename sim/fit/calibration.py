"""Bias of the depth of a wall: a scale, taken for the baseline's drift, and an offset of the disparity.

A turn of the right eye about its y axis shifts all disparities alike; other angles and the focal length bend
the depth of a wall, which nobody measures apart from the texture.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.sim.fit.estimate import UNKNOWN, Estimate
from digs_warp.sim.fit.wall import Wall
from digs_warp.sim.sensor.drift import NO_DRIFT, Drift

# A line through fewer points has no scatter to tell its error from.
FEWEST_POSES = 3

# Distances differ enough for a scale if their disparities do by this factor.
LEVER = 1.3


@dataclass(frozen=True)
class Bias:
    """measured = scale * true + offset, in disparity; ``offset`` in px."""

    offset: Estimate = UNKNOWN
    scale: Estimate = UNKNOWN

    def figures(self, focal: float) -> dict[str, Estimate]:
        """Return figures of the rig: from one unit, the size of its drift is taken for the spread of all.

        Args:
            focal: of the eye [px].
        """
        if not self.scale.is_known:
            return {}
        yaw, baseline = np.rad2deg(self.offset.value / focal), self.scale.value - 1
        return {
            "rotation_drift": Estimate(abs(yaw), float(np.rad2deg(self.offset.error / focal))),
            "baseline_drift": Estimate(abs(baseline), self.scale.error),
        }

    def drift(self, focal: float) -> Drift:
        """Return the drift of a unit with this bias."""
        if not self.scale.is_known:
            return NO_DRIFT
        yaw = float(np.rad2deg(self.offset.value / focal))
        return Drift(yaw_deg=yaw, baseline=self.scale.value - 1)


def bias(wall: Wall, distances: Sequence[float] | None) -> Bias:
    """Return the bias by a straight line through the poses; its error follows from how far they lie off it.

    Args:
        wall: its planes tell what was measured.
        distances: depth of the wall on the optical axis at each pose, from the nearest to the farthest [m];
            None: not known, and neither is the bias.
    """
    if distances is None or len(distances) < FEWEST_POSES:
        return Bias()
    true = wall.focal_baseline / np.array(distances)
    measured = wall.focal_baseline / np.array([wall.distance(pose) for pose in wall.poses])
    if true.max() < LEVER * true.min():
        return Bias()
    return Bias(*fit_line(true, measured))


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
