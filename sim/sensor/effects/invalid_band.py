"""The invalid band: the left margin of the image lies outside the right eye's view and has no match."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed


@dataclass(frozen=True)
class InvalidBand:
    """Holes along the left margin, f b / Z pixels wide."""

    name: ClassVar[str] = "invalid-band"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if anything in view has a disparity of half a pixel: then a column may be lost."""
        return choose_above(
            self.name,
            "max_disparity",
            facts.max_disparity,
            0.5,
            "px",
            on="the left margin lies outside the right eye's view",
            off="everything is so far away that both eyes see the same",
        )

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Drop points that land left of the right image; ``strength`` does not matter: this is geometry."""
        columns = np.arange(truth.depth.shape[1], dtype=np.float32) + np.float32(0.5)
        # Only columns left of the largest disparity can be lost.
        reach = truth.disparity.max(initial=0.0, where=~np.isnan(truth.disparity))
        width = min(int(np.ceil(float(reach))), truth.depth.shape[1])
        outside = np.zeros(truth.depth.shape, dtype=bool)
        outside[:, :width] = truth.disparity[:, :width] > columns[:width]
        return sensed.with_holes(outside, Cause.BAND)
