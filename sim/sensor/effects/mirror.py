"""Mirrors: the images show the reflected scene; the search has to try its disparity, too."""

from dataclasses import dataclass
from typing import ClassVar

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.effects.protocol import Choice, choose_by_share
from digs_warp.sim.sensor.facts import SceneFacts

# Rays to what each mirroring pixel reflects [ms/MP of such pixels].
RAYS = 600.0


@dataclass(frozen=True)
class Mirror:
    """The virtual image in smooth metal, as a candidate: the images decide what is matched."""

    name: ClassVar[str] = "mirror"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if smooth metal is in view."""
        return choose_by_share(
            self.name,
            "mirror_share",
            facts.mirror_share,
            RAYS * facts.mirror_share,
            on="smooth metal reflects the scene: the reflection may be matched, not the surface",
            off="no smooth metal in view",
        )
