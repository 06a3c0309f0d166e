"""Single frames whose poses contradict the color and depth of all frames around them, and where they belong.

Structure from motion may place a frame by what is far, which tells where a camera looks and hardly where it
is. Its frames then agree with each other but for one, which agrees with none, or has nothing in common with
any.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from digs_warp.device.threads import over_items
from digs_warp.geometry.rigid import invert_rigid
from digs_warp.poses.agreement import disagreement, disagreements, reduced
from digs_warp.poses.align import align, align_first
from digs_warp.poses.chain import BROKEN
from digs_warp.poses.correlation import correlation
from digs_warp.poses.features import features_of
from digs_warp.poses.of_pairs import measured_pairs, medians_of_frames
from digs_warp.poses.pairs import overlapping_pairs
from digs_warp.poses.resection import Sightings
from digs_warp.poses.views import Picture, View, view_of

# Fewer frames do not tell which of them is wrong, and neither do more wrong ones than this share.
FEWEST, MOST_WRONG = 5, 0.25
# A frame is misplaced that disagrees with others by this much more than the frames usually do, and by this
# many standard deviations (from the median of what they differ by): right ones reach 3.
LEAST_APART, DEVIATIONS = 0.15, 4.0
SIGMAS = 1.4826
# What is brighter or darker than its neighbors disagrees, too, but its details match. A frame is lost if they
# match less than this share of what is usual.
MATCHING = 0.6
# Poses are right enough to compare details where these usually correlate by this much: half a degree of error
# leaves 0.1 to 0.28, right ones reach 0.4 to 0.8. A frame in a wrong place then has less than this share.
TELLING, UNLIKE = 0.3, 0.33
# Neighbors in time by which a frame is placed; placings that are tried, and those that are followed.
NEIGHBORS, TRIED, FOLLOWED = 6, 200, 3
# Points that are looked up for each that is tried.
COARSE_SAMPLES = 250


@dataclass(frozen=True, eq=False)
class Mended:
    """What became of misplaced frames.

    Attributes:
        poses: ``world_from_cam`` of all frames, (n, 4, 4); new ones for those that were moved.
        start: the same, to align all frames from: aligned ones, if a frame could be placed only among them.
        moved: numbers of the frames that were registered again, and now agree as others do.
        lost: numbers of the frames that agree with no other, wherever they are placed.
    """

    poses: np.ndarray
    start: np.ndarray
    moved: tuple[int, ...] = ()
    lost: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class _Looks:
    """Frames as they are, and at the size at which they are compared."""

    pictures: Sequence[Picture]

    @cached_property
    def small(self) -> list[Picture]:
        return reduced(self.pictures)

    @cached_property
    def views(self) -> list[View]:
        """Of the small ones."""
        return over_items(self.small, view_of)


def mended(pictures: Sequence[Picture], poses: np.ndarray) -> Mended:
    """Register again what agrees far less with the frames around it than all others do.

    Args:
        pictures: of n frames, in order of time; what has no depth stays where it is.
        poses: ``world_from_cam``, (n, 4, 4).
    """
    looks = _Looks(pictures)
    pairs = overlapping_pairs(looks.small, poses)
    apart = _apart(looks, poses, pairs)
    known = np.isfinite(apart)
    if np.count_nonzero(known) < FEWEST:
        return Mended(poses, poses)
    limit = _limit(apart)
    wrong = np.flatnonzero(apart > limit)
    if len(wrong) > MOST_WRONG * np.count_nonzero(known):
        return Mended(poses, poses)
    untouched = pairs[~np.isin(pairs, wrong).any(axis=1)]
    strange = _strange(pictures, known, _matches(looks, poses, untouched), wrong)
    if not len(wrong) + len(strange):
        return Mended(poses, poses)
    right = np.setdiff1d(np.flatnonzero(known), np.union1d(wrong, strange))
    placed = _with_placed(looks, poses, wrong, right)
    after = _apart(looks, placed, overlapping_pairs(looks.small, placed))
    holds = after < np.minimum(limit, apart - LEAST_APART)
    left = wrong[~holds[wrong]]
    placed[left] = poses[left]
    mend = Mended(placed, placed, _numbers(wrong[holds[wrong]]))
    doubted = left[apart[left] > BROKEN]
    if not len(doubted) + len(strange):
        return mend
    return _mended_among_aligned(looks, mend, doubted, strange, right)


def _strange(
    pictures: Sequence[Picture], known: np.ndarray, matches: np.ndarray, wrong: np.ndarray
) -> np.ndarray:
    """Return the numbers of frames that nothing contradicts, and that have little in common with the others.

    They may be in a wrong place, or see what no other sees.

    Args:
        pictures: of n frames.
        known: whether each has something in common with others, (n,).
        matches: how well its details match theirs, (n,); NaN: unknown.
        wrong: numbers of frames that others contradict.
    """
    has_depth = np.array([bool(np.isfinite(each.depth).any()) for each in pictures])
    usual = np.nanmedian(matches)
    strange = has_depth & ~known
    if usual >= TELLING:
        strange |= matches < UNLIKE * usual
    found = np.setdiff1d(np.flatnonzero(strange), wrong)
    few = len(found) + len(wrong) <= MOST_WRONG * np.count_nonzero(has_depth)
    return found if few else found[:0]


def _with_placed(
    looks: _Looks, poses: np.ndarray, wrong: np.ndarray, right: np.ndarray
) -> np.ndarray:
    """Return the poses, those of wrong frames by right ones."""
    placed = poses.copy()
    for number in wrong:
        placed[number] = _placed(looks, poses, int(number), right)
    return placed


def _limit(apart: np.ndarray) -> float:
    usual = np.nanmedian(apart)
    spread = SIGMAS * np.nanmedian(np.abs(apart - usual))
    return float(usual + max(LEAST_APART, DEVIATIONS * spread))


def _apart(looks: _Looks, poses: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return the median disagreement of each frame with the others, (n,); NaN for what has no pair."""
    found = measured_pairs(disagreement, looks.small, poses, pairs)
    return medians_of_frames(pairs, len(poses), found)


def _placed(looks: _Looks, poses: np.ndarray, number: int, right: np.ndarray) -> np.ndarray:
    """Return the pose of a frame by the features and the alignment of right neighbors; they stay."""
    pictures, small = looks.pictures, looks.small
    near = right[np.argsort(np.abs(right - number), kind="stable")[:NEIGHBORS]]
    features = over_items([pictures[each] for each in (number, *near)], features_of)
    others = list(zip(features[1:], poses[near], strict=True))
    starts = Sightings.of(pictures[number], features[0], others).placings(TRIED)

    def doubts(tried: Sequence[np.ndarray], most: int) -> np.ndarray:
        def against(other: int) -> np.ndarray:
            motions = [invert_rigid(pose) @ poses[other] for pose in tried]
            return disagreements(small[other], small[number], motions, most)

        return np.mean(over_items(list(near), against), axis=0)

    best: list[np.ndarray] = [poses[number]]
    if starts:
        order = np.argsort(doubts(starts, COARSE_SAMPLES), kind="stable")[:FOLLOWED]
        best += [starts[each] for each in order]
    group = [pictures[each] for each in (number, *near)]
    aligned = [align_first(group, np.stack([pose, *poses[near]])) for pose in best]
    tried = [*best, *aligned]
    # Where nothing is shared, little is contradicted: there, details that match tell right poses.
    views = [looks.views[each] for each in (number, *near)]
    matching = [_matching(views, np.stack([pose, *poses[near]])) for pose in tried]
    return tried[int(np.argmin(doubts(tried, 3 * COARSE_SAMPLES) - matching))]


def _matching(views: Sequence[View], poses: np.ndarray) -> float:
    """Return how well details of the first frame match those of the others."""
    pairs = np.array([(0, other) for other in range(1, len(views))])
    return float(np.mean(measured_pairs(correlation, views, poses, pairs)))


def _mended_among_aligned(
    looks: _Looks,
    mend: Mended,
    doubted: np.ndarray,
    strange: np.ndarray,
    right: np.ndarray,
) -> Mended:
    """Place what is left once the others are aligned: before, all poses may be a little off.

    What was in doubt, and then neither agrees with the others nor matches their details, is lost. What was
    strange, and does not match them, stays where it was.
    """
    doubted_or_strange = np.union1d(doubted, strange)
    others = np.setdiff1d(np.arange(len(looks.pictures)), doubted_or_strange)
    start = mend.poses.copy()
    alignment = align([looks.pictures[each] for each in others], start[others])
    if alignment is not None:
        start[others] = alignment.poses
    start = _with_placed(looks, start, doubted_or_strange, right)
    pairs = overlapping_pairs(looks.small, start)
    apart, matches = _apart(looks, start, pairs), _matches(looks, start, pairs)
    agrees = matches >= MATCHING * np.nanmedian(matches[right])
    start[strange] = np.where(agrees[strange, None, None], start[strange], mend.poses[strange])
    agrees[doubted] |= apart[doubted] <= min(BROKEN, _limit(apart[right]))
    poses = mend.poses.copy()
    found, lost = doubted_or_strange[agrees[doubted_or_strange]], doubted[~agrees[doubted]]
    poses[found] = start[found]
    return Mended(poses, start, tuple(sorted(mend.moved + _numbers(found))), _numbers(lost))


def _matches(looks: _Looks, poses: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return how well each frame's details match those of the others, (n,); NaN for what has no pair."""
    found = measured_pairs(correlation, looks.views, poses, pairs)
    return medians_of_frames(pairs, len(poses), found)


def _numbers(some: np.ndarray) -> tuple[int, ...]:
    return tuple(map(int, some))
