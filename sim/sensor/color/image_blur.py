"""Motion blur of the images: the camera moves while the shutter is open.

The images are the mean of several views along the way, in linear light, so that edges, highlights and
masks blur as they do in a camera. `digs_warp.sim.shutter` renders them; this file says how many are needed.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.rig import StereoRig
from digs_warp.sim.sensor.effects.protocol import Choice, choose_above
from digs_warp.sim.sensor.facts import SceneFacts

# Blur below half a pixel hides behind the pixel's own size.
VISIBLE_BLUR_PX = 0.5

# Views per exposure: a pixel is as wide as itself, so views this far apart [px] leave no gap that one
# could see; beyond 16 the cost outgrows the use.
VIEW_PX = 1.5
MIN_VIEWS, MAX_VIEWS = 2, 16


@dataclass(frozen=True)
class ImageBlur:
    """Spreads the exposure over the motion."""

    name: ClassVar[str] = "image-blur"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """It acts where the image moves by a visible amount during the exposure."""
        return choose_above(
            self.name,
            "blur_px",
            facts.blur_px,
            VISIBLE_BLUR_PX,
            "px",
            on="the hand moves far enough during an exposure to blur the images",
            off="the shutter is too fast for the hand to blur the images",
        )

    def views(self, facts: SceneFacts, strength: float = 1.0) -> int:
        """Return how many views make one exposure, ``strength`` times as long as the rig's."""
        return int(np.clip(np.ceil(strength * facts.blur_px / VIEW_PX), MIN_VIEWS, MAX_VIEWS))
