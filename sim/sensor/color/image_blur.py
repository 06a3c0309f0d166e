"""Motion blur of the images: the camera moves while the shutter is open.

An image is the mean of several views along the path, in linear light, so that edges, highlights and masks
blur as in a camera. `digs_warp.sim.camera.shutter` renders them; this file decides how many are needed.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.effects.protocol import Choice, choose_by_share
from digs_warp.sim.sensor.facts import SceneFacts

# Views per exposure: views this far apart [px] leave no visible gap; more than 16 are not worth their cost.
VIEW_PX = 1.5
MIN_VIEWS, MAX_VIEWS = 2, 16

# The usual rays of a pixel are shared among the views; every further view of both eyes costs [ms/MP]:
USUAL_RAYS, VIEW_COST = 4, 650.0


@dataclass(frozen=True)
class ImageBlur:
    """Spreads the exposure over the motion."""

    name: ClassVar[str] = "image-blur"

    def choose(self, facts: SceneFacts, rig: StereoRig) -> Choice:
        """On if the image moves visibly during the exposure."""
        return choose_by_share(
            self.name,
            "blurred_share",
            facts.blurred_share,
            VIEW_COST * max(0, self.views(facts) - USUAL_RAYS),
            on="the hand moves far enough during an exposure to blur the images",
            off="the shutter is too fast for the hand to blur the images",
        )

    def views(self, facts: SceneFacts, strength: float = 1.0) -> int:
        """Return the number of views per exposure, which is ``strength`` times as long as the rig's."""
        return int(np.clip(np.ceil(strength * facts.blur_px / VIEW_PX), MIN_VIEWS, MAX_VIEWS))
