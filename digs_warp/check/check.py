"""Looks at a capture before any work and names what does not fit together, with the likely cause."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.check.agreement import Agreement, agreement
from digs_warp.check.alignment_doubts import alignment_doubts
from digs_warp.check.causes import doubts_about_path, doubts_about_range, likely_cause
from digs_warp.check.finding import Finding
from digs_warp.check.mask_doubts import mask_doubts
from digs_warp.check.motion_doubts import motion_doubts
from digs_warp.check.small_frames import SmallFrame, neighbors, small_frames
from digs_warp.data.capture import Capture


@dataclass(frozen=True)
class Plausibility:
    """What the check found.

    Attributes:
        agreement: of neighboring frames as recorded; None where poses or depth are unknown.
        findings: what does not fit, the gravest first; empty for a good capture.
    """

    agreement: Agreement | None = None
    findings: tuple[Finding, ...] = ()

    @property
    def doubts(self) -> tuple[str, ...]:
        """The findings as sentences."""
        return tuple(map(str, self.findings))


def check_capture(capture: Capture, *, poses: bool = True, masks: bool = True) -> Plausibility:
    """Return what does not fit together in a capture, judged from a few pairs of neighboring frames.

    A capture without poses is only checked for the range of its depth, its alignment and its masks; one
    without depth for nothing.

    Args:
        capture: the recording.
        poses: whether its poses matter.
        masks: whether its masks matter.

    Raises:
        DigsError: a file that cannot be read.
    """
    knows_poses = poses and capture.knows_poses
    pairs = neighbors(capture.frames)
    numbers = sorted({number for pair in pairs for number in pair}) or [0]
    frames = small_frames(capture.frames, numbers)
    if not any(np.isfinite(frame.depth).any() for frame in frames.values()):
        return Plausibility()
    pairs = [pair for pair in pairs if pair[0] in frames and pair[1] in frames]
    looks = _doubts_about_looks(list(frames.values()), masks)
    if not (knows_poses and pairs):
        return Plausibility(None, (*doubts_about_range(frames), *looks))
    as_recorded = agreement(frames, pairs)
    cause = likely_cause([frame.camera for frame in capture.frames], frames, pairs, as_recorded)
    if cause:  # what moves and where cameras stand cannot be told then
        return Plausibility(as_recorded, (cause, *looks))
    found = [*doubts_about_range(frames), *doubts_about_path(frames, pairs), *looks]
    return Plausibility(as_recorded, (*found, *_doubts_about_motion(found, frames, pairs)))


def _doubts_about_looks(frames: Sequence[SmallFrame], masks: bool) -> list[Finding]:
    """Return whether depth, images and masks lie over each other; the masks can tell more exactly."""
    of_masks = mask_doubts(frames) if masks else []
    not_aligned = [] if of_masks else alignment_doubts(frames)
    return [*not_aligned, *of_masks]


def _doubts_about_motion(
    found: Sequence[Finding],
    frames: Mapping[int, SmallFrame],
    pairs: Sequence[tuple[int, int]],
) -> list[Finding]:
    """Return what moves, unless errors found before would look the same."""
    return [] if any(each.is_error for each in found) else motion_doubts(frames, pairs)
