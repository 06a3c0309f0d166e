"""Depth, poses and focal length against each other: which wrong unit or convention explains disagreement."""

from collections.abc import Mapping, Sequence

import numpy as np

from digs_warp.check.agreement import Agreement, agreement
from digs_warp.check.explanations import Explanation, explanations
from digs_warp.check.finding import Finding
from digs_warp.check.small_frames import SmallFrame
from digs_warp.geometry.camera import Camera

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


def likely_cause(
    cameras: Sequence[Camera],
    frames: Mapping[int, SmallFrame],
    pairs: Sequence[tuple[int, int]],
    as_recorded: Agreement,
) -> Finding | None:
    """Return the explanation with which the frames agree best, if they agree much better with it.

    Args:
        cameras: of all frames of the recording.
        frames: thumbnails by their numbers in it.
        pairs: those that are compared.
        as_recorded: how well they agree.
    """
    enough = max(CONVINCING, BETTER * as_recorded.score + MARGIN)
    if enough >= 1.0:  # no agreement is larger; this one leaves none of the findings below
        return None
    tried = [
        (agreement({n: each.corrected(frame) for n, frame in frames.items()}, pairs), each)
        for each in explanations(cameras)
    ]
    explained, best = max(tried, key=lambda pair: pair[0].score)
    if explained.overlap >= OVERLAP and explained.score > enough:
        what = (
            f"Neighboring frames agree to {as_recorded.score:.0%}. They would agree to "
            f"{explained.score:.0%} if this was corrected: {best.cause}."
        )
        return Finding(best.kind, what, best.advice)
    if as_recorded.overlap < OVERLAP:
        return None
    if _is_depth_of_other_images(tried, as_recorded):
        what = (
            f"The depth of neighboring frames agrees to {as_recorded.depth:.0%}, but much better with the "
            "poses of other frames: depth and images were not taken at the same time."
        )
        return Finding("time stamps", what, "Check the timestamps.")
    if as_recorded.score < HOPELESS:
        what = (
            f"Neighboring frames agree to {as_recorded.score:.0%}, and no wrong unit, focal length or "
            "convention explains it: images, depth and poses do not belong together."
        )
        return Finding("order", what, "Check the order of the frames and their timestamps.")
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


def doubts_about_range(frames: Mapping[int, SmallFrame]) -> list[Finding]:
    """Return a finding if no depth camera measures such depths."""
    depth = _median_depth(frames)
    if NEAREST <= depth <= FARTHEST:
        return []
    what = (
        f"The median depth is {depth:.3g} m, expected {NEAREST:g} to {FARTHEST:g} m: it seems to be in "
        "another unit."
    )
    mend = "Write float images in metres, or 16-bit images in millimetres."
    return [Finding("depth unit", what, mend)]


def doubts_about_path(
    frames: Mapping[int, SmallFrame], pairs: Sequence[tuple[int, int]]
) -> list[Finding]:
    """Return a finding if the camera moves so far that neighboring frames cannot have anything in common."""
    centers = {number: frame.camera.center_world for number, frame in frames.items()}
    step = float(np.median([np.linalg.norm(centers[a] - centers[b]) for a, b in pairs]))
    depth = _median_depth(frames)
    if step <= APART * depth:
        return []
    what = (
        f"The camera moves {step:.3g} m between neighboring frames, but the median depth is {depth:.3g} m: "
        "poses and depth seem to be in different units."
    )
    return [Finding("path", what, "Both are in metres (16-bit depth: millimetres).")]


def _median_depth(frames: Mapping[int, SmallFrame]) -> float:
    return float(np.nanmedian(np.concatenate([f.depth.reshape(-1) for f in frames.values()])))
