"""Rolling shutter: each row is exposed a little later than the one above it.

Both eyes read the same row at the same time, so the depth of each row is right; but the frame as a whole is
distorted with respect to the one pose recorded with it. Rows are rendered in bands, each from the camera's
pose at that time (`digs_warp.sim.camera.shutter`): depth, mask and images are distorted together.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.effects.protocol import Choice, choose_by_share
from digs_warp.sim.sensor.facts import SceneFacts

# Jump between neighboring bands: too small to be seen.
STEP_PX = 0.5
MIN_BANDS, MAX_BANDS = 2, 32

COST = 60.0  # of rendering in bands [ms/MP]


@dataclass(frozen=True)
class RollingShutter:
    """Renders each row from the pose at which it was read."""

    name: ClassVar[str] = "rolling-shutter"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if the image moves visibly while the rows are read."""
        return choose_by_share(
            self.name,
            "skewed_share",
            facts.skewed_share,
            COST,
            on="the hand moves far enough while the rows are read to distort the images",
            off="the rows are read too fast, or all at once, for the hand to distort the images",
        )

    def bands(self, facts: SceneFacts, rig: StereoRig, strength: float = 1.0) -> int:
        """Return the number of bands of rows; ``strength`` stretches the read-out time."""
        bands = int(np.clip(np.ceil(strength * facts.skew_px / STEP_PX), MIN_BANDS, MAX_BANDS))
        return min(bands, rig.intrinsics.height)
