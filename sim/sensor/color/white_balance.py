"""Automatic white balance: the camera takes the scene for gray on average, and follows it with a lag."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.color.encoding import amplified
from digs_warp.sim.sensor.color.protocol import EyeImages
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts

# Smallest correction that viewers notice: a fifth more or less of red or blue [stops] [tuned].
VISIBLE_TINT = 0.25


@dataclass(frozen=True)
class WhiteBalance:
    """Gains of red and blue for both images that remove a share of the color cast."""

    name: ClassVar[str] = "white-balance"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if the images have a strong color cast, and the camera corrects it."""
        return choose_above(
            self.name,
            "white_balance x color_cast",
            rig.white_balance * facts.color_cast,
            VISIBLE_TINT,
            "stops",
            on="the scene has a color cast: the camera corrects its white balance",
            off="one white balance fits all frames",
        )

    def apply(
        self, eyes: EyeImages, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> EyeImages:
        """Multiply red and blue as the camera has adapted; noise grows along."""
        tint = eyes.adaptation.scaled(strength).tint
        return amplified(eyes, tint, tint)
