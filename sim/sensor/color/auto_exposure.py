"""Automatic exposure: the camera meters every frame and brightens or darkens it toward middle gray."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.color.protocol import MIDDLE_GREY, EyeImages
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts

# Share of saturated and dark pixels above which a camera corrects the exposure [tuned].
BADLY_EXPOSED = 0.1

MAX_STOPS = 1.5  # largest correction of the recording's common exposure [tuned]

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)  # Rec. 709
CLIPPED = 0.995  # linear; the two highest 8-bit values: the true brightness there is lost


@dataclass(frozen=True)
class AutoExposure:
    """One gain for both images, from the mean of the left one."""

    name: ClassVar[str] = "auto-exposure"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if much of the images is saturated or black."""
        return choose_above(
            self.name,
            "saturated_share + dark_share",
            facts.saturated_share + facts.dark_share,
            BADLY_EXPOSED,
            "",
            on="much of the images is too bright or too dark: the camera corrects every frame",
            off="one exposure fits all frames",
        )

    def apply(
        self, eyes: EyeImages, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> EyeImages:
        """Move the left image's mean luminance toward middle gray, by at most MAX_STOPS."""
        luminance = float(eyes.left.mean(axis=(0, 1), dtype=np.float64) @ LUMINANCE)
        stops = np.log2(MIDDLE_GREY / luminance) if luminance > 0 else MAX_STOPS
        gain = np.float32(2.0 ** (strength * np.clip(stops, -MAX_STOPS, MAX_STOPS)))
        return eyes.with_images(_exposed(eyes.left, gain), _exposed(eyes.right, gain))


def _exposed(linear: np.ndarray, gain: np.float32) -> np.ndarray:
    """Return the image times the gain; white stays white, because its true brightness is unknown."""
    return np.where(linear >= CLIPPED, linear, np.minimum(linear * gain, 1.0))
