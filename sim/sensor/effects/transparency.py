"""Transparency: the images show the background behind glass; the search has to try its disparity, too."""

from dataclasses import dataclass
from typing import ClassVar

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts

# The effect switches on if a larger share of the surface in view is transparent.
MIN_SHARE = 1e-3


@dataclass(frozen=True)
class Transparency:
    """The surface behind the glass, as a candidate: the images decide which of the two is matched."""

    name: ClassVar[str] = "transparency"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if a transparent material is in view."""
        return choose_above(
            self.name,
            "transparent_share",
            facts.transparent_share,
            MIN_SHARE,
            "",
            on="something transparent is in view: the background behind it may be matched",
            off="nothing transparent in view",
        )
