"""Random invalid pixels: real sensors drop a few percent for no visible reason."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed


@dataclass(frozen=True)
class RandomInvalid:
    """Single pixels without a value: 2.1 to 2.4 % in the first ZED (Ortiz et al. 2018)."""

    name: ClassVar[str] = "random-invalid"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On for every rig that drops pixels."""
        return choose_above(
            self.name,
            "random_invalid",
            rig.random_invalid,
            0.0,
            "",
            on="this sensor drops pixels for no visible reason",
            off="the rig drops no pixels at random",
        )

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Drop pixels independently of each other; ``strength`` is a factor on their share."""
        share = min(strength * truth.rig.random_invalid, 1.0)
        dropped = np.zeros(truth.depth.shape, dtype=bool)
        if share >= 1:
            dropped[:] = True
        else:
            # A Poisson number of hits, several of which may fall on the same pixel, misses each pixel with
            # probability exp(-rate), independently; far fewer draws than one per pixel.
            hits = rng.poisson(-dropped.size * np.log1p(-share))
            dropped.reshape(-1)[rng.integers(0, dropped.size, hits)] = True
        return sensed.with_holes(dropped, Cause.RANDOM)
