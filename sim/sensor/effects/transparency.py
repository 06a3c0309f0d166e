"""Transparency: the sensor measures what lies behind the glass, or the glass in patches."""

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

# Share of the surface in view that must be transparent before the effect shows.
MIN_SHARE = 1e-4


@dataclass(frozen=True)
class Transparency:
    """Depth of what lies behind, as often as it is seen more strongly than the surface itself."""

    name: ClassVar[str] = "transparency"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """Switch on when a transparent material is in view."""
        return choose_above(
            self.name,
            "transparent_share",
            facts.transparent_share,
            MIN_SHARE,
            "",
            on="something transparent is in view: what lies behind it is matched",
            off="nothing transparent in view",
        )

    def apply(
        self, sensed: Sensed, truth: FrameTruth, rng: np.random.Generator, strength: float = 1.0
    ) -> Sensed:
        """Match what lies behind; ``strength`` below 1 is the share of the glass that is missed."""
        glass = pixels_of(truth, is_transparent) if strength > 0 else None
        if glass is None or not glass.any():
            return sensed
        # The stronger gradient wins; with equal texture on both that is a matter of how much is seen.
        through = np.array([1 - m.opacity * (1 - m.transmission) for m in truth.materials])
        keep_patches(rng, glass, through[truth.material_ids[glass]] * min(strength, 1.0))
        # The ray goes straight on: refraction is left out of the rendered images, too.
        behind = np.float32(truth.rig.focal_baseline) / truth.rays.depth_behind(glass)
        return sensed.with_values(glass, behind, Cause.TRANSPARENT, confidence=0.8)
