"""Textureless areas: smoothness carries disparity in from the rim, but only so far."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from sim.rig import StereoRig
from sim.sensor.cause import Cause
from sim.sensor.effects.protocol import Choice, choose_above
from sim.sensor.facts import TEXTURE_REACH, SceneFacts
from sim.sensor.frame import FrameTruth, Sensed
from sim.sensor.noise_field import patchy_uniform

# Semi-global matching of plain discs in good texture: a radius of 20 px is filled and right; 40, 80, 120
# px fail over 6, 34 and 53 % of the area. Failure at a distance t from the last window with texture, of
# probability 1 - exp(-(t - 20) / 14), gives 7, 34 and 51 %.
DECAY = 14.0  # [px]

# On a slope of 0.05 px/px the same discs fail over 37, 74 and 92 %: smoothness wants constant disparity.
# Reach and decay divided by 1 + 30 |slope| give 43, 67 and 77 %.
SLOPE_GAIN = 30.0

# Of the failed pixels of these discs 0 to a half become holes; the rest is wrong and confident.
HOLE_SHARE = 0.35

# Failures come in patches of this size, wrong by 1 px and up to this much more [px] [tuned].
PATCH, WRONG_ERROR = 24.0, 3.0


@dataclass(frozen=True)
class Textureless:
    """Holes and wrong depth far from any texture; thresholding the local gradient would get it wrong."""

    name: ClassVar[str] = "textureless"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """Switch on when something is farther from texture than smoothness reaches."""
        return choose_above(
            self.name,
            "textureless_radius",
            facts.textureless_radius,
            TEXTURE_REACH,
            "px",
            on="parts of the surface are too far from anything that can be matched",
            off="texture is never far: smoothness fills the plain parts",
        )

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Make holes and wrong values; ``strength`` divides the reach of smoothness."""
        gain = strength * (1 + SLOPE_GAIN * np.abs(truth.slope))
        beyond = truth.texture_distance * gain - np.float32(TEXTURE_REACH)
        if not (beyond > 0).any():
            return sensed
        draw = patchy_uniform(rng, truth.depth.shape, PATCH)
        failed = draw < -np.expm1(np.minimum(-beyond, 0.0) / np.float32(DECAY))
        # Another draw, so that the fate does not depend on how likely the failure was.
        fate = patchy_uniform(rng, truth.depth.shape, PATCH)
        lost = fate < HOLE_SHARE
        sign = np.where(fate > 0.5 * (1 + HOLE_SHARE), np.float32(1), np.float32(-1))
        wrong = sensed.disparity + sign * (1 + np.float32(WRONG_ERROR) * draw)
        sensed = sensed.with_values(
            failed & ~lost & sensed.known, wrong, Cause.TEXTURELESS, confidence=0.5
        )
        return sensed.with_holes(failed & lost, Cause.TEXTURELESS)
