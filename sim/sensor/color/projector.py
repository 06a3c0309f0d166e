"""The projector of an infrared pair: dots give texture to plain walls, where other light does not drown them.

`digs_warp.sim.render.projector` draws them; this file decides whether they show.
"""

from dataclasses import dataclass
from typing import ClassVar

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts

# Dots that drown in the image noise in all but this share of the view do not help a matcher [tuned].
MIN_SHARE = 0.01

COST = 500.0  # of its rays and spots in both eyes [ms/MP]


@dataclass(frozen=True)
class Projector:
    """Draws pseudo-random dots into the infrared pair."""

    name: ClassVar[str] = "projector"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if the center of a dot would stand out of the image noise."""
        return choose_above(
            self.name,
            "dot_share",
            facts.dot_share,
            MIN_SHARE,
            "",
            COST if rig.projector_power > 0 else 0.0,
            on="the projector's dots show: they are texture for the infrared pair",
            off="other light drowns the projector's dots"
            if rig.projector_power > 0
            else "the camera has no projector",
        )
