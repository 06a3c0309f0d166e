"""Pixel locking: sub-pixel interpolation pulls disparities toward whole pixels."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed


@dataclass(frozen=True)
class Ripple:
    """An error that is a sine of the disparity's fractional part, with a period of 1 px.

    Measured on ideal pairs, by octant of the fraction: -.024 -.076 -.112 -.062 +.111 +.174 +.139 +.067 px;
    half of that on a real pair. It does not change from frame to frame and averages out over views.
    """

    name: ClassVar[str] = "ripple"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On for every rig with a ripple."""
        return choose_above(
            self.name,
            "ripple",
            rig.ripple,
            0.0,
            "px",
            on="sub-pixel interpolation pulls disparity toward whole pixels",
            off="the rig interpolates without bias",
        )

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Add the ripple of the sensed disparity; ``strength`` is a factor on its amplitude."""
        # The fraction first: the sine of a large float32 angle would not be exact enough.
        # In place: every extra image in memory costs as much as the arithmetic.
        error = np.floor(sensed.disparity)
        np.subtract(sensed.disparity, error, out=error)
        error *= np.float32(2 * np.pi)
        np.sin(error, out=error)
        error *= np.float32(-strength * truth.rig.ripple)
        return sensed.shifted(error)
