"""Transparency: the sensor measures the background behind the glass, or, in patches, the glass."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.coherent import keep_patches
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.materials import is_transparent, pixels_of

# The effect switches on if a larger share of the surface in view is transparent.
MIN_SHARE = 1e-4


@dataclass(frozen=True)
class Transparency:
    """Depth of the background, wherever it shows more strongly than the surface itself."""

    name: ClassVar[str] = "transparency"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if a transparent material is in view."""
        return choose_above(
            self.name,
            "transparent_share",
            facts.transparent_share,
            MIN_SHARE,
            "",
            on="something transparent is in view: the background behind it is matched",
            off="nothing transparent in view",
        )

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Match the background; ``strength`` below 1 is the share of the glass that is missed."""
        glass = pixels_of(truth, is_transparent) if strength > 0 else None
        if glass is None or not glass.any():
            return sensed
        # The stronger gradient wins; with equal texture on both, that depends on how much shows through.
        through = np.array([1 - m.opacity * (1 - m.transmission) for m in truth.materials])
        keep_patches(rng, glass, through[truth.material_ids[glass]] * min(strength, 1.0))
        # The ray goes straight on: the rendered images have no refraction either.
        behind = np.float32(truth.rig.focal_baseline) / truth.rays.depth_behind(glass)
        return sensed.with_values(glass, behind, Cause.TRANSPARENT, confidence=0.8)
