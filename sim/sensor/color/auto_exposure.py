"""Automatic exposure and white balance: the camera follows the scene toward middle gray, with a lag."""

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


# Share of saturated and dark pixels above which a camera corrects the exposure [tuned].
BADLY_EXPOSED = 0.1


@dataclass(frozen=True)
class AutoExposure:
    """One gain for both images, from the mean of the left one over the last moments."""

    name: ClassVar[str] = "auto-exposure"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if much of the images is saturated or black."""
        return choose_above(
            self.name,
            "saturated_share + dark_share",
            facts.saturated_share + facts.dark_share,
            BADLY_EXPOSED,
            "",
            on="much of the images is too bright or too dark: the camera corrects its exposure",
            off="one exposure fits all frames",
        )

    def apply(
        self, eyes: EyeImages, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> EyeImages:
        """Expose both images as the camera has adapted; an electronic gain will raise the noise."""
        adapted = eyes.adaptation.scaled(strength)
        electronic = adapted.electronic_gain(rig)
        gain = 2.0**adapted.exposure
        return amplified(eyes, (gain, gain, gain), (electronic, electronic, electronic))
