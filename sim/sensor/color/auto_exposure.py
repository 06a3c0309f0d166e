"""Automatic exposure: the camera follows the brightness of the scene toward middle gray, with a lag."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.color.encoding import amplified
from digs_warp.sim.sensor.color.protocol import EyeImages
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts

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
