"""Rolling shutter: each row is exposed a little later than the one above it.

Both eyes read the same row at the same time, so depth stays right for what a row sees; but the frame as
a whole is bent against the one pose that is recorded with it. Rows are rendered in bands, each from
where the camera was then (`digs_warp.sim.shutter`): depth, mask and images bend together.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts

# Skew below half a pixel from first to last row bends nothing that anybody could measure.
VISIBLE_SKEW_PX = 0.5

# Between neighbouring bands the image jumps by this much: too little to see as a step.
STEP_PX = 0.5
MIN_BANDS, MAX_BANDS = 2, 32


@dataclass(frozen=True)
class RollingShutter:
    """Shows each row from where the camera was when the row was read."""

    name: ClassVar[str] = "rolling-shutter"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """It acts where the image moves by a visible amount while the rows are read."""
        return choose_above(
            self.name,
            "skew_px",
            facts.skew_px,
            VISIBLE_SKEW_PX,
            "px",
            on="the hand moves far enough while the rows are read to bend the images",
            off="the rows are read too fast, or all at once, for the hand to bend the images",
        )

    def bands(self, facts: SceneFacts, rig: StereoRig, strength: float = 1.0) -> int:
        """Return into how many bands of rows the image is cut; ``strength`` stretches the read-out."""
        bands = int(np.clip(np.ceil(strength * facts.skew_px / STEP_PX), MIN_BANDS, MAX_BANDS))
        return min(bands, rig.intrinsics.height)
