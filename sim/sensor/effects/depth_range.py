"""The range: too near for the search, or too far to distinguish from infinity."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.limit import within_range

# Room for noise at the ends of the range [px].
MARGIN = 2.0


@dataclass(frozen=True)
class DepthRange:
    """Holes where the sensed depth is outside the rig's range, marked as too near or too far."""

    name: ClassVar[str] = "depth-range"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if anything in view is close to or beyond an end of the range."""
        smallest = rig.focal_baseline / rig.max_depth
        on = bool(
            facts.max_disparity > rig.largest_disparity - MARGIN
            or facts.min_disparity < smallest + MARGIN
        )
        reason = (
            "parts of the scene lie near or beyond the ends of the sensor's range"
            if on
            else "the whole scene lies well within the sensor's range"
        )
        statistic = f"disparity = {facts.min_disparity:.1f} to {facts.max_disparity:.1f} px"
        threshold = f"outside {smallest + MARGIN:.1f} to {rig.largest_disparity - MARGIN:.1f} px"
        return Choice(self.name, on, statistic, threshold, reason)

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Drop values out of range; ``strength`` does not change the range: it is a limit, not an error.

        The sensor drops them at the end in any case. Here, before random pixels drop out, every lost pixel
        still gets its label.
        """
        return within_range(sensed, truth.rig)
