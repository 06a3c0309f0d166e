"""Mirrors: the sensor measures the reflected scene, behind the surface."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.coherent import keep_patches
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.materials import is_mirror, pixels_of
from digs_warp.sim.sensor.virtual_image import virtual_disparity

# The effect switches on if a larger share of the surface in view is a mirror.
MIN_SHARE = 1e-4


@dataclass(frozen=True)
class Mirror:
    """Depth of the virtual image in smooth metal."""

    name: ClassVar[str] = "mirror"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if smooth metal is in view."""
        return choose_above(
            self.name,
            "mirror_share",
            facts.mirror_share,
            MIN_SHARE,
            "",
            on="smooth metal reflects the scene: the reflection is matched, not the surface",
            off="no smooth metal in view",
        )

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Replace the surface by its reflection; ``strength`` below 1 is the share that is replaced."""
        mirrors = pixels_of(truth, is_mirror) if strength > 0 else None
        if mirrors is None or not mirrors.any():
            return sensed
        if strength < 1:
            keep_patches(rng, mirrors, strength)
        return sensed.with_values(
            mirrors, virtual_disparity(truth, mirrors), Cause.MIRROR, confidence=0.8
        )
