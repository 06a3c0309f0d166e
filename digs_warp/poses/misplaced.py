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
from digs_warp.poses.align import align_first
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
        poses: ``world_from_cam`` of all frames, (n, 4, 4); new ones for some.
        moved: numbers of the frames that were registered again, and now agree as others do.
        lost: numbers of the frames that agree with no other and could not be placed.
    """

    poses: np.ndarray
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
        return Mended(poses)
    limit = _limit(apart[known])
    wrong = np.flatnonzero(known & (apart > limit))
    right = np.flatnonzero(known & (apart <= limit))
    if not len(wrong) or len(wrong) > MOST_WRONG * np.count_nonzero(known):
        return Mended(poses)
    placed = poses.copy()
    for number in wrong:
        placed[number] = _placed(pictures, small, poses, int(number), right)
    after = _apart(small, placed, overlapping_pairs(small, placed))
    holds = after < np.minimum(limit, apart - LEAST_APART)
    left = wrong[~holds[wrong]]
    placed[left] = poses[left]
    return Mended(
        placed,
        moved=tuple(map(int, wrong[holds[wrong]])),
        lost=_lost(small, placed, left[apart[left] > BROKEN], right),
    )


def _limit(apart: np.ndarray) -> float:
    usual = np.median(apart)
    spread = SIGMAS * np.median(np.abs(apart - usual))
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
    return tried[int(np.argmin(doubts(tried, 3 * COARSE_SAMPLES)))]


def _lost(
    pictures: Sequence[Picture], poses: np.ndarray, doubted: np.ndarray, right: np.ndarray
) -> tuple[int, ...]:
    """Return which of the doubted frames' details match those of no other frame."""
    if not len(doubted):
        return ()
    views = over_items(pictures, view_of)
    pairs = overlapping_pairs(pictures, poses)
    matching = measured_pairs(correlation, views, poses, pairs)
    found = medians_of_frames(pairs, len(poses), matching)
    usual = np.nanmedian(found[right])
    return tuple(int(each) for each in doubted if not found[each] >= MATCHING * usual)
