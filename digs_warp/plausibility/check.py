"""Looks at a capture before any work and names what does not fit together, with the likely cause."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.plausibility.agreement import Agreement, agreement
from digs_warp.plausibility.alignment_doubts import alignment_doubts
from digs_warp.plausibility.explanations import Explanation, explanations
from digs_warp.plausibility.mask_doubts import mask_doubts
from digs_warp.plausibility.small_frames import SmallFrame, neighbors, small_frames

# Depth cameras measure medians in this range [m].
NEAREST, FARTHEST = 0.01, 100.0

# Frames this many median depths apart see nothing in common.
APART = 5.0

# An explanation counts if, with it, the frames agree this well and look at this much in common ...
CONVINCING, OVERLAP = 0.3, 0.25

# ... and agree better than as recorded by this factor and this difference.
BETTER, MARGIN = 1.12, 0.03

# Frames that look at much in common but agree less than this do not belong together. Simulated captures with
# all errors of the sensor at twice their strength reach 0.13.
HOPELESS = 0.1

# The depth belongs to other images if, with other poses, the depth agrees better by this factor.
OTHER_DEPTH = 1.25


@dataclass(frozen=True)
class Plausibility:
    """What the check found.

    Attributes:
        agreement: of neighboring frames as recorded; None where poses or depth are unknown.
        doubts: a sentence or two for each thing that does not fit; empty for a good capture.
    """

    agreement: Agreement | None = None
    doubts: tuple[str, ...] = ()


def check_capture(capture: Capture, *, poses: bool = True, masks: bool = True) -> Plausibility:
    """Return what does not fit together in a capture, judged from a few pairs of neighboring frames.

    A capture without poses is only checked for the range of its depth, its alignment and its masks.

    Args:
        capture: the recording.
        poses: whether its poses matter.
        masks: whether its masks matter.

    Raises:
        DigsError: a file that cannot be read.
    """
    pairs = neighbors(capture.frames)
    numbers = sorted({number for pair in pairs for number in pair}) or [0]
    frames = small_frames(capture.frames, numbers)
    if not any(np.isfinite(frame.depth).any() for frame in frames.values()):
        return Plausibility()
    pairs = [pair for pair in pairs if pair[0] in frames and pair[1] in frames]
    doubts = alignment_doubts(list(frames.values()))
    doubts += mask_doubts(list(frames.values())) if masks else []
    if not (poses and capture.knows_poses and pairs):
        return Plausibility(None, (*_doubts_about_range(frames), *doubts))
    as_recorded = agreement(frames, pairs)
    cause = _likely_cause(capture, frames, pairs, as_recorded)
    found = [cause] if cause else [*_doubts_about_range(frames), *_doubts_about_path(frames, pairs)]
    return Plausibility(as_recorded, (*found, *doubts))


def _likely_cause(
    capture: Capture,
    frames: Mapping[int, SmallFrame],
    pairs: Sequence[tuple[int, int]],
    as_recorded: Agreement,
) -> str | None:
    """Return the explanation with which the frames agree best, if they agree much better with it."""
    cameras = [frame.camera for frame in capture.frames]
    tried = [
        (agreement({n: each.corrected(frame) for n, frame in frames.items()}, pairs), each)
        for each in explanations(cameras)
    ]
    explained, best = max(tried, key=lambda pair: pair[0].score)
    enough = max(CONVINCING, BETTER * as_recorded.score + MARGIN)
    if explained.overlap >= OVERLAP and explained.score > enough:
        return (
            f"Neighboring frames agree to {as_recorded.score:.0%}. They would agree to "
            f"{explained.score:.0%} if this was corrected: {best.cause}. {best.advice}"
        )
    if as_recorded.overlap < OVERLAP:
        return None
    if _is_depth_of_other_images(tried, as_recorded):
        return (
            f"The depth of neighboring frames agrees to {as_recorded.depth:.0%}, but much better with the "
            "poses of other frames: depth and images were not taken at the same time. Check the timestamps."
        )
    if as_recorded.score < HOPELESS:
        return (
            f"Neighboring frames agree to {as_recorded.score:.0%}, and no wrong unit, focal length or "
            "convention explains it: images, depth and poses do not belong together. Check the order of "
            "the frames and their timestamps."
        )
    return None


def _is_depth_of_other_images(
    tried: Sequence[tuple[Agreement, Explanation]], as_recorded: Agreement
) -> bool:
    return any(
        each.delays
        and found.overlap >= OVERLAP
        and found.depth > OTHER_DEPTH * as_recorded.depth
        and found.brightness < as_recorded.brightness
        for found, each in tried
    )


def _doubts_about_range(frames: Mapping[int, SmallFrame]) -> list[str]:
    depth = _median_depth(frames)
    if NEAREST <= depth <= FARTHEST:
        return []
    return [
        f"The median depth is {depth:.3g} m, expected {NEAREST:g} to {FARTHEST:g} m: it seems to be in "
        "another unit. Write float images in metres, or 16-bit images in millimetres."
    ]


def _doubts_about_path(
    frames: Mapping[int, SmallFrame], pairs: Sequence[tuple[int, int]]
) -> list[str]:
    centers = {number: frame.camera.center_world for number, frame in frames.items()}
    step = float(np.median([np.linalg.norm(centers[a] - centers[b]) for a, b in pairs]))
    depth = _median_depth(frames)
    if step <= APART * depth:
        return []
    return [
        f"The camera moves {step:.3g} m between neighboring frames, but the median depth is {depth:.3g} m: "
        "poses and depth seem to be in different units. Both are in metres (16-bit depth: millimetres)."
    ]


def _median_depth(frames: Mapping[int, SmallFrame]) -> float:
    return float(np.nanmedian(np.concatenate([f.depth.reshape(-1) for f in frames.values()])))
