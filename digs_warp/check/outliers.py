"""Outliers: frames whose depth, mask or features contradict the others, and where a recording breaks in two.

Depth of neighboring frames is compared at the recorded poses. A frame that none agrees with, between frames
that agree with each other, has a broken pose, or depth of another moment. Where frames agree on either side
but not across, two recordings are in one, or the poses jump: tracking was lost and found again. Masks are
compared where both frames measure the same surface.

Without depth, matched features tell (`digs_warp.poses.photo_matches`). Where those of two neighbors agree on
some motion, but not on the recorded one, and those of other neighbors do, the poses jump. Two photographs
cannot tell how far the camera moved: a jump in just the direction of the step is not noticed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from digs_warp.check import thresholds as limits
from digs_warp.check.evidence import Evidence, same_depth_share, shared_points
from digs_warp.data.layers import Layer
from digs_warp.data.viewpoints import spread
from digs_warp.measure.thumbnails import SmallFrame, small_frames
from digs_warp.poses.photo_matches import agreeing_shares
from digs_warp.poses.thresholds import USUAL_MATCH_SHARE
from digs_warp.words import counted, first_few

# Longer recordings are thinned evenly; frames up to this far apart are compared.
MOST_FRAMES, REACH = 300, 2

# Of longer recordings without depth, only the first steps are looked at.
MOST_STEPS = 120


@dataclass(frozen=True)
class Links:
    """How well frames agree with those up to `REACH` before and after them.

    Attributes:
        names: of the frames.
        relative: agreement of two frames with anything in common, over what is typical of neighbors.
    """

    names: tuple[str, ...]
    relative: dict[frozenset[int], float]

    def contradict(self, first: int, second: int, below: float) -> bool:
        """Whether two frames agree less than this share of what is typical: they measure different things."""
        return self.relative.get(frozenset((first, second)), np.nan) < below

    def agree(self, first: int, second: int) -> bool:
        """Whether two frames measure the same."""
        return self.relative.get(frozenset((first, second)), np.nan) > limits.AGREEING_SHARE


def links(evidence: Evidence) -> Links | None:
    """Return how depth agrees; None without poses or depth, or where single frames are lost in noise."""
    return _links(evidence, _share, 0.5)


def mask_links(evidence: Evidence) -> Links | None:
    """Return how the masks of frames agree; None also without masks, or where most are wrong."""
    has_masks = all(frame.has(Layer.MASK) for frame in evidence.capture.frames)
    # Each wrong one spoils two pairs of neighbors: the better ones say what is usual.
    return _links(evidence, _mask_share, 0.75) if has_masks and evidence.uses_masks else None


def _links(
    evidence: Evidence,
    share: Callable[[SmallFrame, SmallFrame], float | None],
    quantile: float,
) -> Links | None:
    small = evidence.once(_thinned)
    pairs = [(a, b) for b in range(len(small)) for a in range(max(0, b - REACH), b)]
    compared = {(a, b): share(small[a], small[b]) for a, b in pairs}
    shares = {pair: each for pair, each in compared.items() if each is not None}
    known = [each for (a, b), each in shares.items() if b == a + 1]
    typical = float(np.quantile(known, quantile)) if known else 0.0
    if typical < limits.LEAST_TYPICAL_AGREEMENT:
        return None
    names = tuple(evidence.capture.frames[each.number].name for each in small)
    return Links(names, {frozenset(pair): each / typical for pair, each in shares.items()})


def _thinned(evidence: Evidence) -> list[SmallFrame]:
    """Return thumbnails of frames with depth; none without poses."""
    frames = evidence.capture.frames
    if not evidence.knows_poses or len(frames) < 4:
        return []
    return [*small_frames(frames, spread(len(frames), MOST_FRAMES)).values()]


def _share(first: SmallFrame, second: SmallFrame) -> float | None:
    """Return the share of points in common at the same depth in both; None: hardly any in common."""
    seen = [shared_points(first, second), shared_points(second, first)]
    overlap = limits.OUTLIER_OVERLAP * sum(each.looked_at for each in seen)
    if sum(len(each.depth) for each in seen) < max(limits.LEAST_POINTS_IN_COMMON, overlap):
        return None
    return same_depth_share(seen)


def _mask_share(first: SmallFrame, second: SmallFrame) -> float | None:
    """Return the overlap of two masks on surfaces that both frames measure; None: hardly any in common."""
    seen = [shared_points(first, second), shared_points(second, first)]
    marks = [(s.marked_here[s.same_surface], s.marked_there[s.same_surface]) for s in seen]
    here, there = map(np.concatenate, zip(*marks, strict=True))
    either = np.count_nonzero(here | there)
    return np.count_nonzero(here & there) / either if either >= limits.FEWEST_MARKED else None


def contradicting(
    measure: Callable[[Evidence], Links | None], what: str
) -> Callable[[Evidence, float], dict[str, Any] | None]:
    """Return the check for frames that contradict all around them, where those agree with each other."""

    def look(evidence: Evidence, below: float) -> dict[str, Any] | None:
        found = evidence.once(measure)
        if found is None or not (odd := alone(found, below)):
            return None
        names = first_few([found.names[i] for i in odd])
        return {"odd": counted(len(odd), what), "count": len(found.names), "names": names}

    return look


def alone(found: Links, below: float) -> list[int]:
    """Return the numbers of those frames; none where two parts of a path meet that share little."""
    outliers, count = [], len(found.names)
    for i in range(count):
        around = [j for j in range(i - REACH, i + REACH + 1) if j != i and 0 <= j < count]
        against = [j for j in around if found.contradict(i, j, below)]
        together = any(found.agree(a, b) for a in against for b in against if a < b)
        sides = ((i - 2, i - 1), (i + 1, i + 2))
        parts_meet = found.contradict(i - 1, i + 1, below)
        parts_meet &= not any(found.contradict(*pair, below) for pair in sides)
        confirmed = any(found.agree(i, j) for j in around)
        if len(against) >= 2 and together and not (parts_meet or confirmed):
            outliers.append(i)
    return outliers


def breaks(evidence: Evidence, below: float) -> dict[str, Any] | None:
    """Find frames after which nothing agrees with what was before, while each side agrees in itself."""
    found = evidence.once(links)
    if found is None:
        return None
    outliers, places = alone(found, below), []
    for i in range(1, len(found.names) - 2):
        across = [(i, i + 1), (i - 1, i + 1), (i, i + 2)]
        sides = found.agree(i - 1, i) and found.agree(i + 1, i + 2)
        against = sum(found.contradict(*pair, below) for pair in across)
        is_break = sides and against >= 2 and not any(found.agree(*pair) for pair in across)
        if is_break and not {i, i + 1} & set(outliers):
            places.append(f"{found.names[i]} and {found.names[i + 1]}")
    return {"places": first_few(places)} if places else None


def pose_jumps(evidence: Evidence, wrong: float) -> dict[str, Any] | None:
    """Find steps where less than this share of the matches that agree with each other agree with the poses.

    Nothing with depth, which tells more, or without poses.
    """
    frames = evidence.capture.frames[: MOST_STEPS + 1]
    if not evidence.knows_poses or any(frame.has(Layer.DEPTH) for frame in frames):
        return None
    shares = agreeing_shares(frames)
    valid = [share for share in shares if share is not None]
    if len(valid) < 3 or np.median(valid) < USUAL_MATCH_SHARE:
        return None
    steps = [i for i, share in enumerate(shares) if share is not None and share < wrong]
    places = [f"{frames[i].name} and {frames[i + 1].name}" for i in steps]
    return {"places": first_few(places)} if places else None
