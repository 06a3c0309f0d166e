"""Textureless areas: smoothness carries disparity in from the rim, but not far."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import TEXTURE_REACH, SceneFacts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.noise_field import patchy_uniform

# Semi-global matching of plain discs in good texture: a radius of 20 px is filled correctly; radii of 40,
# 80 and 120 px fail over 6, 34 and 53 % of the area. A probability of failure of 1 - exp(-(t - 20) / 14) at
# a distance t from the nearest window with texture gives 7, 34 and 51 %.
DECAY = 14.0  # [px]

# On a slope of 0.05 px/px the same discs fail over 37, 74 and 92 %: smoothness prefers constant disparity.
# Reach and decay divided by 1 + 30 |slope| give 43, 67 and 77 %.
SLOPE_GAIN = 30.0

# Up to half of the failed pixels of these discs become holes, and two thirds of those in rendered scenes; the
# others are wrong and confident.
HOLE_SHARE = 0.45

# Failures come in patches of this size, wrong by 1 px and up to this much more [px] [tuned].
PATCH, WRONG_ERROR = 24.0, 3.0


@dataclass(frozen=True)
class Textureless:
    """Holes and wrong depth far from any texture; thresholding the local gradient would be wrong."""

    name: ClassVar[str] = "textureless"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if something is farther from texture than smoothness reaches."""
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
        # In place: every extra image in memory costs as much as the arithmetic.
        beyond = np.abs(truth.slope)
        beyond *= np.float32(strength * SLOPE_GAIN)
        beyond += np.float32(strength)
        beyond *= truth.texture_distance
        at = np.flatnonzero(beyond > TEXTURE_REACH)
        at = at[~np.isnan(sensed.disparity.reshape(-1)[at])]
        if len(at) == 0:
            return sensed
        shape = truth.depth.shape
        excess = beyond.reshape(-1)[at] - np.float32(TEXTURE_REACH)
        draw = patchy_uniform(rng, shape, PATCH).reshape(-1)[at]
        failed = draw < -np.expm1(excess / np.float32(-DECAY))
        # A new draw, so that the outcome does not depend on how likely the failure was.
        at, draw = at[failed], draw[failed]
        fate = patchy_uniform(rng, shape, PATCH).reshape(-1)[at]
        lost, farther = fate < HOLE_SHARE, fate > 0.5 * (1 + HOLE_SHARE)
        error = np.where(farther, np.float32(1), np.float32(-1)) * (
            1 + np.float32(WRONG_ERROR) * draw
        )
        value = sensed.disparity.reshape(-1)[at] + error
        value[lost] = np.nan
        confidence = np.where(lost, np.float32(0.0), np.float32(0.5))
        return sensed.with_pixels(at, value, Cause.TEXTURELESS, confidence)
