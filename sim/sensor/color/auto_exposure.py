"""Automatic exposure and white balance: the camera follows the scene toward middle gray, with a lag."""

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.color.encoding import amplified
from digs_warp.sim.sensor.color.protocol import EyeImages, PixelEffect
from digs_warp.sim.sensor.facts import SceneFacts


class WhiteBalance(PixelEffect):
    """The camera takes the scene for gray on average, and removes a share of its color cast, with a lag."""

    name = "white-balance"
    statistic = "white_balance x color_cast"
    limit = 0.25  # the smallest correction that viewers notice: a fifth more or less of red or blue [tuned]
    unit = "stops"
    on = "the scene has a color cast: the camera corrects its white balance"
    off = "one white balance fits all frames"

    def measured(self, facts: SceneFacts, rig: StereoRig) -> float:
        """Return what the camera would correct."""
        return rig.white_balance * facts.color_cast

    def apply(
        self, eyes: EyeImages, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> EyeImages:
        """Multiply red and blue as the camera has adapted; noise grows along."""
        tint = eyes.adaptation.scaled(strength).tint
        return amplified(eyes, tint, tint)


class AutoExposure(PixelEffect):
    """The camera follows the brightness of the left image to middle gray, with a lag: one gain for both."""

    name = "auto-exposure"
    statistic = "saturated_share + dark_share"
    limit = 0.1  # above it, a camera corrects the exposure [tuned]
    on = "much of the images is too bright or too dark: the camera corrects its exposure"
    off = "one exposure fits all frames"

    def measured(self, facts: SceneFacts, rig: StereoRig) -> float:
        """Return the share that is badly exposed."""
        return facts.saturated_share + facts.dark_share

    def apply(
        self, eyes: EyeImages, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> EyeImages:
        """Expose both images as the camera has adapted; an electronic gain will raise the noise."""
        adapted = eyes.adaptation.scaled(strength)
        electronic = adapted.electronic_gain(rig)
        gain = 2.0**adapted.exposure
        return amplified(eyes, (gain, gain, gain), (electronic, electronic, electronic))
