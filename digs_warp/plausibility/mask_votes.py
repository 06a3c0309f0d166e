"""What the other views say about a mask: each point that a frame measures is looked up in their masks.

A point that most views call surround is surround, whatever one mask says.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from digs_warp.data.evenly import evenly
from digs_warp.device.threads import default_threads
from digs_warp.plausibility.seen_through import in_hull, seen_through
from digs_warp.plausibility.small_frames import SmallDepth, pixels_showing

# This many other views vote: of the nearer half of all, every n-th.
VOTERS = 12

# A view votes on a point if it measures it at the same depth, within this share.
SAME_DEPTH = 0.05

# Fewer votes on a pixel say nothing, nor do votes on less than this share of the image.
FEWEST_VOTES, LEAST_KNOWN = 3, 0.1

# A mask that overlaps with the votes by less is contradicted. Good masks of nine simulated objects do not
# fall below it, even where 10 of 24 are empty, cut in half or hold a neighboring object; of those, 9 do.
AGREES = 0.65

# Where the best quarter of the masks overlaps by less than this, the depth is too bad to vote. Good depth
# reaches 0.83, that of a thin, mirroring sword 0.54.
TRUSTED, BEST = 0.67, 0.75


@dataclass(frozen=True, eq=False)
class MaskVotes:
    """The votes on one mask.

    Attributes:
        known: pixels of the thumbnail on which votes count, (height, width), bool.
        is_object: those of them that most views call object.
        agreement: overlap of the mask with all votes (intersection over union); 1 where they say too little.
        without_glass: the same with ``known`` and ``is_object``, which leave out votes on what is seen
            through glass.
    """

    known: np.ndarray
    is_object: np.ndarray
    agreement: float
    without_glass: float


def mask_votes(frames: Sequence[SmallDepth]) -> list[MaskVotes]:
    """Return the votes on the mask of each frame; all of them have masks.

    There are two rounds: in the second one only the half votes that agreed best in the first. Where they
    contradict a mask, votes on what is seen through glass are left out.
    """
    first = _round(frames, range(len(frames)))
    middle = np.median([each.agreement for each in first])
    voters = [number for number, each in enumerate(first) if each.agreement >= middle]
    votes = _round(frames, voters)
    for number, each in enumerate(votes):
        if each.agreement < AGREES:
            others = evenly([other for other in voters if other != number], VOTERS)
            votes[number] = _without_glass(frames[number], each, [frames[n] for n in others])
    return votes


def _round(frames: Sequence[SmallDepth], voters: Sequence[int]) -> list[MaskVotes]:
    centers = np.stack([frame.camera.center_world for frame in frames])

    def votes(number: int) -> MaskVotes:
        return _votes(frames[number], [frames[n] for n in _nearer(centers, number, voters)])

    with ThreadPoolExecutor(default_threads()) as pool:
        return list(pool.map(votes, range(len(frames))))


def contradicted(votes: Sequence[MaskVotes]) -> list[int]:
    """Return the numbers of the masks that the others contradict; none where the votes cannot be trusted."""
    agreements = [each.agreement for each in votes if (each.known & each.is_object).any()]
    # Where the votes find no object in most frames, most masks are empty: they tell nothing of the others.
    if 2 * len(agreements) <= len(votes) or np.quantile(agreements, BEST) < TRUSTED:
        return []
    return [number for number, each in enumerate(votes) if each.without_glass < AGREES]


def _nearer(centers: np.ndarray, number: int, voters: Sequence[int]) -> list[int]:
    """Return those of the voters that vote on a frame."""
    others = np.array([other for other in voters if other != number], dtype=int)
    away = np.linalg.norm(centers[others] - centers[number], axis=1)
    nearer = others[np.argsort(away, kind="stable")][: max(VOTERS, len(others) // 2)]
    return nearer[:: max(1, len(nearer) // VOTERS)][:VOTERS].tolist()


def _without_glass(frame: SmallDepth, votes: MaskVotes, others: Sequence[SmallDepth]) -> MaskVotes:
    """Return the votes without those on what is seen through glass: there, depth lies behind a right mask.

    Glass in this frame: the votes on what is behind say nothing of the mask. Glass in other frames: what they
    see through it is no part of the object, for a part lies in the outline in all views.
    """
    assert frame.mask is not None
    known, is_object = votes.known.copy(), votes.is_object.copy()
    rows, columns = np.nonzero(known & frame.mask & ~is_object)
    known[rows, columns] = ~seen_through(frame, rows, columns, others)
    rows, columns = np.nonzero(is_object & ~frame.mask)
    is_object[rows, columns] = in_hull(frame.points_at(rows, columns), others)
    overlap = _overlap(frame.mask, known, is_object)
    return replace(votes, known=known, is_object=is_object, without_glass=overlap)


def _votes(frame: SmallDepth, others: Sequence[SmallDepth]) -> MaskVotes:
    rows, columns = np.nonzero(np.isfinite(frame.depth))
    points = frame.points_at(rows, columns)
    votes, for_object = np.zeros((2, len(points)))
    for other in others:
        assert other.mask is not None
        pixel, depth = pixels_showing(other.camera, points)
        measured = other.depth.reshape(-1)[pixel]
        with np.errstate(invalid="ignore"):
            sees = (pixel >= 0) & (np.abs(measured - depth) < SAME_DEPTH * depth)
        votes += sees
        for_object += sees & other.mask.reshape(-1)[pixel]
    known, is_object = np.zeros((2, *frame.depth.shape), dtype=bool)
    enough = votes >= FEWEST_VOTES
    known[rows[enough], columns[enough]] = True
    is_object[rows[enough], columns[enough]] = for_object[enough] > votes[enough] / 2
    assert frame.mask is not None
    agreement = _overlap(frame.mask, known, is_object)
    return MaskVotes(known, is_object, agreement, agreement)


def _overlap(mask: np.ndarray, known: np.ndarray, is_object: np.ndarray) -> float:
    either = np.count_nonzero(known & (mask | is_object))
    if known.mean() < LEAST_KNOWN or not (known & is_object).any():
        return 1.0
    return np.count_nonzero(known & mask & is_object) / either
