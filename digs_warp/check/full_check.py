"""Everything that can be found wrong with a capture before any work, and what could not be looked at."""

from dataclasses import asdict, dataclass
from typing import Any

from digs_warp.check.agreement_of_masks import masks_that_disagree
from digs_warp.check.check import Plausibility, check_capture
from digs_warp.check.finding import Finding
from digs_warp.check.frame_doubts import frame_doubts
from digs_warp.check.photographs import Photographs, look_at_photographs
from digs_warp.check.repeats import repeats
from digs_warp.check.view_doubts import few_views, gap_in_views
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer


@dataclass(frozen=True)
class FullCheck:
    """What was found.

    Attributes:
        plausibility: whether depth, poses, focal length and masks fit together.
        masks: single masks that the other views contradict.
        frames: single frames that contradict their neighbors, breaks, jumps, a scene that changes, a camera
            that stands still, and frames that repeat the one before.
        views: too few of them, or sides of the object that nobody looked at.
        photographs: what the photographs are like.
        not_checked: what could not be looked at, and why.
    """

    plausibility: Plausibility
    masks: tuple[Finding, ...]
    frames: tuple[Finding, ...]
    views: tuple[Finding, ...]
    photographs: Photographs
    not_checked: tuple[str, ...]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What does not fit or could be better, the gravest first."""
        found = (*self.plausibility.findings, *self.frames)
        more = (*self.masks, *self.views, *self.photographs.findings)
        if any(each.is_error for each in found):
            # What needs right poses and depth says nothing then.
            more = tuple(each for each in more if each.kind == "blur")
        return (*found, *more)

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON values."""
        agreement = self.plausibility.agreement
        return {
            "findings": [asdict(each) | {"is_error": each.is_error} for each in self.findings],
            "agreement": None if agreement is None else asdict(agreement),
            "photographs": asdict(self.photographs),
            "not_checked": list(self.not_checked),
        }


def check_fully(capture: Capture) -> FullCheck:
    """Look at a whole capture; this takes seconds.

    Raises:
        DigsError: a file that cannot be read.
    """
    plausibility = check_capture(capture)
    return FullCheck(
        plausibility,
        tuple(masks_that_disagree(capture)),
        _of_frames(capture, plausibility),
        tuple(few_views(capture) or gap_in_views(capture)),
        look_at_photographs(capture),
        _not_checked(capture),
    )


def _of_frames(capture: Capture, plausibility: Plausibility) -> tuple[Finding, ...]:
    """Return what is odd about some of the frames; where all poses are wrong, nothing tells it."""
    wrong = any(each.is_error for each in plausibility.findings)
    return (*([] if wrong else frame_doubts(capture)), *repeats(capture))


def _not_checked(capture: Capture) -> tuple[str, ...]:
    has_depth, has_masks = (
        any(frame.has(layer) for frame in capture.frames) for layer in (Layer.DEPTH, Layer.MASK)
    )
    missing = []
    if not has_depth:
        missing.append("units, focal length, pose convention, exposure, moving things: need depth")
    elif not capture.knows_poses:
        missing.append("focal length, pose convention, exposure, moving things: need poses")
    if not has_masks:
        missing.append("masks, and gaps in the way around the object: need masks")
    return tuple(missing)
