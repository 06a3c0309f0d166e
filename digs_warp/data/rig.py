"""The two eyes of a stereo camera, as a capture knows them."""

from dataclasses import asdict, dataclass
from typing import Any

from digs_warp.checks import CaptureError
from digs_warp.record.fields import ABOVE_ZERO, Fields


@dataclass(frozen=True)
class Rig:
    """The two eyes from which depth is measured, side by side along the x axis of the frame's camera.

    Attributes:
        baseline: distance of the eyes [m].
        infrared: the eyes are an infrared pair beside the frame's camera; None: the left eye is that camera.
    """

    baseline: float
    infrared: "InfraredPair | None" = None

    def as_json(self) -> dict[str, Any]:
        """Return the rig in the form of transforms.json."""
        pair = {} if self.infrared is None else {"infrared": asdict(self.infrared)}
        return {"baseline": self.baseline, **pair}


@dataclass(frozen=True)
class InfraredPair:
    """Two equal infrared cameras that look the same way as the frame's camera, at its image size.

    Attributes:
        offset: place of the left one along the x axis of the frame's camera [m].
        fl_x, fl_y, cx, cy: focal lengths and principal point of either [px].
    """

    offset: float
    fl_x: float
    fl_y: float
    cx: float
    cy: float


def read_rig(ours: dict[str, Any], where: str) -> Rig | None:
    """Return what `Rig.as_json` wrote; None if there is none.

    Args:
        ours: our section of the index.
        where: prefix of messages, which names the file.
    """
    if "rig" not in ours:
        return None
    rig = Fields.of(ours["rig"], f"{where}, rig", CaptureError)
    baseline = rig.number("baseline", ABOVE_ZERO, what="metres above 0")
    if "infrared" not in rig:
        return Rig(baseline)
    pair = rig.section("infrared")
    fl_x, fl_y = (pair.number(name, ABOVE_ZERO, what="pixels above 0") for name in ("fl_x", "fl_y"))
    return Rig(
        baseline,
        InfraredPair(pair.number("offset"), fl_x, fl_y, pair.number("cx"), pair.number("cy")),
    )
