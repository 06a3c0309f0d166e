"""Quantization: disparity is reported in steps of a fraction of a pixel."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.frame import Sensed

COST = 2.0  # [ms/MP]


@dataclass(frozen=True)
class Quantum:
    """Rounding to the rig's disparity step: 1/16 px in OpenCV, 1/32 in a D435, 1/8 in an OAK-D."""

    name: ClassVar[str] = "quantum"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On for every rig with disparity steps."""
        return choose_above(
            self.name,
            "disparity_step",
            rig.disparity_step,
            0.0,
            "px",
            COST,
            on="the sensor reports disparity in fixed point",
            off="the rig reports disparity without steps",
        )

    def apply(
        self, sensed: Sensed, rig: StereoRig, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Round the disparity; ``strength`` is a factor on the step."""
        step = np.float32(strength * rig.disparity_step)
        if step <= 0:
            return sensed
        steps = np.rint(sensed.disparity / step)
        steps *= step
        return replace(sensed, disparity=steps)
