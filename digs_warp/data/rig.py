"""The two eyes of a stereo camera, as a capture knows them."""

from dataclasses import dataclass
from typing import Annotated

from digs_warp.record.typed import Expect

METRES = Expect("metres above 0", lambda value: value > 0)
PIXELS = Expect("pixels above 0", lambda value: value > 0)


@dataclass(frozen=True)
class InfraredPair:
    """Two equal infrared cameras that look the same way as the frame's camera, at its image size.

    Attributes:
        offset: place of the left one along the x axis of the frame's camera [m].
        fl_x, fl_y, cx, cy: focal lengths and principal point of either [px].
    """

    offset: float
    fl_x: Annotated[float, PIXELS]
    fl_y: Annotated[float, PIXELS]
    cx: float
    cy: float


@dataclass(frozen=True)
class Rig:
    """The two eyes from which depth is measured, side by side along the x axis of the frame's camera.

    Attributes:
        baseline: distance of the eyes [m].
        infrared: the eyes are an infrared pair beside the frame's camera; None: the left eye is that camera.
    """

    baseline: Annotated[float, METRES]
    infrared: InfraredPair | None = None
