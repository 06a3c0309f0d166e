"""Exposure: saturated and black areas have no texture."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.facts import DARK, SATURATED, TEXTURE_REACH, SceneFacts
from digs_warp.sim.sensor.filters import distance_to, erode
from digs_warp.sim.sensor.frame import FrameTruth, Sensed

# The effect switches on if a larger share of the surface in view is too bright or too dark.
MIN_SHARE = 1e-3


@dataclass(frozen=True)
class Exposure:
    """Holes where a whole matching window is saturated or black.

    Some rigs drop all of these (ZED: remove_saturated_areas). On the others, smoothness fills in from the
    rim, as in any textureless area.
    """

    name: ClassVar[str] = "exposure"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if part of the image is saturated or black."""
        on = max(facts.saturated_share, facts.dark_share) > MIN_SHARE
        reason = (
            "parts of the image are clipped or black: nothing to match"
            if on
            else "the image is well exposed"
        )
        statistic = (
            f"saturated_share = {facts.saturated_share:.2%}, dark_share = {facts.dark_share:.2%}"
        )
        return Choice(self.name, on, statistic, f"either > {MIN_SHARE:.1%}", reason)

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Make holes; ``strength`` moves both limits toward the middle of the gray values."""
        bright = 255 - (255 - SATURATED) * strength
        window = truth.rig.window
        clipped = erode(truth.gray > bright, window) | erode(truth.gray < DARK * strength, window)
        if not truth.rig.drops_saturated and clipped.any():
            clipped = distance_to(~clipped) > TEXTURE_REACH
        return sensed.with_holes(clipped, Cause.EXPOSURE)
