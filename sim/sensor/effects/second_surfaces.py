"""Mirrors and glass: the images show another surface; the search has to try its disparity, too."""

from dataclasses import dataclass
from typing import ClassVar

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.effects.protocol import Choice, choose_by_share
from digs_warp.sim.sensor.facts import SceneFacts

# Rays to what lies behind each transparent pixel [ms/MP of such pixels].
GLASS_RAYS = 400.0


@dataclass(frozen=True)
class Transparency:
    """The surface behind the glass, as a candidate: the images decide which of the two is matched."""

    name: ClassVar[str] = "transparency"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if a transparent material is in view."""
        return choose_by_share(
            self.name,
            "transparent_share",
            facts.transparent_share,
            GLASS_RAYS * facts.transparent_share,
            on="something transparent is in view: the background behind it may be matched",
            off="nothing transparent in view",
        )


# Rays to what each mirroring pixel reflects [ms/MP of such pixels].
MIRROR_RAYS = 600.0


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
            MIRROR_RAYS * facts.mirror_share,
            on="smooth metal reflects the scene: the reflection may be matched, not the surface",
            off="no smooth metal in view",
        )
