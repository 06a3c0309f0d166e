"""Mirrors: the images show the reflected scene; the search has to try its disparity, too."""

from dataclasses import dataclass
from typing import ClassVar

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts

# The effect switches on if a larger share of the surface in view is a mirror.
MIN_SHARE = 1e-3


@dataclass(frozen=True)
class Mirror:
    """The virtual image in smooth metal, as a candidate: the images decide what is matched."""

    name: ClassVar[str] = "mirror"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if smooth metal is in view."""
        return choose_above(
            self.name,
            "mirror_share",
            facts.mirror_share,
            MIN_SHARE,
            "",
            on="smooth metal reflects the scene: the reflection may be matched, not the surface",
            off="no smooth metal in view",
        )
