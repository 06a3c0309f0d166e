"""Single frames whose poses contradict the color and depth of all frames around them, and where they belong.

Structure from motion may place a frame by what is far, which tells where a camera looks and hardly where it
is. Its frames then agree with each other but for one, which agrees with none.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.device.threads import over_items
from digs_warp.geometry import invert_rigid
from digs_warp.poses.agreement import disagreement, disagreements, reduced
from digs_warp.poses.align import align, align_first
from digs_warp.poses.chain import BROKEN
from digs_warp.poses.correlation import correlation
from digs_warp.poses.features import features_of
from digs_warp.poses.of_pairs import measured_pairs, medians_of_frames
from digs_warp.poses.pairs import overlapping_pairs
from digs_warp.poses.resection import Sightings
from digs_warp.poses.views import Picture, view_of

# Fewer frames do not tell which of them is wrong, and neither do more wrong ones than this share.
FEWEST, MOST_WRONG = 5, 0.25
# A frame is misplaced that disagrees with others by this much more than the frames usually do, and by this
# many standard deviations (from the median of what they differ by): right ones reach 3.
LEAST_APART, DEVIATIONS = 0.15, 4.0
SIGMAS = 1.4826
# What is brighter or darker than its neighbors disagrees, too, but its details match. A frame is lost if they
# match less than this share of what is usual.
MATCHING = 0.6
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


def mended(pictures: Sequence[Picture], poses: np.ndarray) -> Mended:
    """Register again what agrees far less with the frames around it than all others do.

    Args:
        pictures: of n frames, in order of time; what has no depth stays where it is.
        poses: ``world_from_cam``, (n, 4, 4).
    """
    small = reduced(pictures)
    apart = _apart(small, poses, overlapping_pairs(small, poses))
    known = np.isfinite(apart)
    if np.count_nonzero(known) < FEWEST:
        return Mended(poses, poses)
    limit = _limit(apart)
    wrong = np.flatnonzero(known & (apart > limit))
    right = np.flatnonzero(known & (apart <= limit))
    if not len(wrong) or len(wrong) > MOST_WRONG * np.count_nonzero(known):
        return Mended(poses, poses)
    placed = _with_placed(pictures, small, poses, wrong, right)
    after = _apart(small, placed, overlapping_pairs(small, placed))
    holds = after < np.minimum(limit, apart - LEAST_APART)
    left = wrong[~holds[wrong]]
    placed[left] = poses[left]
    moved = _numbers(wrong[holds[wrong]])
    doubted = left[apart[left] > BROKEN]
    if not len(doubted):
        return Mended(placed, placed, moved)
    return _mended_among_aligned(pictures, small, Mended(placed, placed, moved), doubted, right)


def _with_placed(
    pictures: Sequence[Picture],
    small: Sequence[Picture],
    poses: np.ndarray,
    wrong: np.ndarray,
    right: np.ndarray,
) -> np.ndarray:
    """Return the poses, those of wrong frames by right ones."""
    placed = poses.copy()
    for number in wrong:
        placed[number] = _placed(pictures, small, poses, int(number), right)
    return placed


def _limit(apart: np.ndarray) -> float:
    usual = np.nanmedian(apart)
    spread = SIGMAS * np.nanmedian(np.abs(apart - usual))
    return float(usual + max(LEAST_APART, DEVIATIONS * spread))


def _apart(pictures: Sequence[Picture], poses: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return the median disagreement of each frame with the others, (n,); NaN for what has no pair."""
    found = measured_pairs(disagreement, pictures, poses, pairs)
    return medians_of_frames(pairs, len(poses), found)


def _placed(
    pictures: Sequence[Picture],
    small: Sequence[Picture],
    poses: np.ndarray,
    number: int,
    right: np.ndarray,
) -> np.ndarray:
    """Return the pose of a frame by the features and the alignment of right neighbors; they stay."""
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
    matching = _matching([small[each] for each in (number, *near)], tried, poses[near])
    return tried[int(np.argmin(doubts(tried, 3 * COARSE_SAMPLES) - matching))]


def _matching(
    pictures: Sequence[Picture], tried: Sequence[np.ndarray], others: np.ndarray
) -> np.ndarray:
    """Return how well the first picture's details match those of the others with each of m poses, (m,)."""
    first, *rest = over_items(pictures, view_of)

    def mean(pose: np.ndarray) -> float:
        pairs = zip(rest, others, strict=True)
        return float(np.mean([correlation(first, v, invert_rigid(at) @ pose) for v, at in pairs]))

    return np.array(over_items(tried, mean))


def _mended_among_aligned(
    pictures: Sequence[Picture],
    small: Sequence[Picture],
    mend: Mended,
    doubted: np.ndarray,
    right: np.ndarray,
) -> Mended:
    """Place what is in doubt once the others are aligned: before, all poses may be a little off.

    What then neither agrees with the others nor matches their details is lost.
    """
    others = np.setdiff1d(np.arange(len(pictures)), doubted)
    start = mend.poses.copy()
    alignment = align([pictures[each] for each in others], start[others])
    if alignment is not None:
        start[others] = alignment.poses
    start = _with_placed(pictures, small, start, doubted, right)
    pairs = overlapping_pairs(small, start)
    matching = measured_pairs(correlation, over_items(small, view_of), start, pairs)
    matches = medians_of_frames(pairs, len(start), matching)
    apart = _apart(small, start, pairs)
    agrees = apart <= min(BROKEN, _limit(apart[right]))
    agrees |= matches >= MATCHING * np.nanmedian(matches[right])
    poses = mend.poses.copy()
    found, lost = doubted[agrees[doubted]], doubted[~agrees[doubted]]
    poses[found] = start[found]
    return Mended(poses, start, tuple(sorted(mend.moved + _numbers(found))), _numbers(lost))


def _numbers(some: np.ndarray) -> tuple[int, ...]:
    return tuple(map(int, some))
