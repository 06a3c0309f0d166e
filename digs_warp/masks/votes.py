"""What the other views say about a mask: each point that a frame measures is looked up in their masks.

A point that most views call surround is surround, whatever one mask says. But a mask may be right although
depth lies behind it: the object is glass, which depth sees through. What the masks of the other views leave
of space tells it (the visual hull; Laurentini, "The visual hull concept for silhouette-based image
understanding", IEEE PAMI 1994): where a pixel's ray passes through that before it comes to the measured
depth, the object may stand there.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import warp as wp

from digs_warp.data.viewpoints import evenly
from digs_warp.device.eyes import eyes_of
from digs_warp.device.parallel import launch_parallel
from digs_warp.device.threads import default_threads
from digs_warp.geometry.reproject import unproject_pixels
from digs_warp.geometry.rigid import transform_points
from digs_warp.masks.config import AGREES
from digs_warp.masks.votes_kernel import votes_kernel
from digs_warp.measure.thumbnails import SmallDepth, pixels_showing

# This many other views vote: of the nearer half of all, every n-th.
VOTERS = 12

# Fewer votes on a pixel say nothing, nor do votes on less than this share of the image.
FEWEST_VOTES, LEAST_KNOWN = 3, 0.1

# Frames whose points the second round finds again: 75 MB.
KEPT = 128

# Where the best quarter of the masks overlaps by less than this, the depth is too bad to vote. Good depth
# reaches 0.83, that of a thin, mirroring sword 0.54.
TRUSTED, BEST = 0.67, 0.75

# Places that are looked at along a ray, each farther by the same factor: 3 to 5 % with walls at 6 m.
PLACES = 64

# The first of them, as a share of the least depth in the frame: glass stands before what is measured.
FIRST = 0.5

# The last of them, as a share of the pixel's depth: nearer to it is what was measured.
LAST = 0.95

# A place is in the hull if at least FEWEST_VIEWS views have it in their image, IN_MASKS of them in the mask.
FEWEST_VIEWS, IN_MASKS = 3, 0.8


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
    views = Views.of(frames)

    @lru_cache(KEPT)
    def measured(number: int) -> MeasuredPoints:
        return MeasuredPoints.of(frames[number])

    first = _round(frames, views, range(len(frames)), measured)
    middle = np.median([each.agreement for each in first])
    voters = [number for number, each in enumerate(first) if each.agreement >= middle]
    votes = _round(frames, views, voters, measured)
    for number, each in enumerate(votes):
        if each.agreement < AGREES:
            others = evenly([other for other in voters if other != number], VOTERS)
            votes[number] = _without_glass(frames[number], each, [frames[n] for n in others])
    return votes


@dataclass(frozen=True, eq=False)
class MeasuredPoints:
    """What a frame measures: pixels of its thumbnail, and the points in the world [m] that they show."""

    rows: np.ndarray
    columns: np.ndarray
    points: wp.array

    @staticmethod
    def of(frame: SmallDepth) -> "MeasuredPoints":
        """Return the pixels with depth."""
        rows, columns = np.nonzero(np.isfinite(frame.depth))
        points = wp.array(frame.points_at(rows, columns), dtype=wp.vec3d, device="cpu")
        return MeasuredPoints(rows, columns, points)


@dataclass(frozen=True, eq=False)
class Views:
    """All frames as the kernel looks them up: cameras, depth maps [m] and masks, one after the other."""

    eyes: wp.array
    depth: wp.array
    masks: wp.array

    @staticmethod
    def of(frames: Sequence[SmallDepth]) -> "Views":
        """Return the frames, all of which have masks, ready to be looked up."""
        masks = [np.asarray(frame.mask, dtype=np.uint8).reshape(-1) for frame in frames]
        depth = np.concatenate([frame.depth.reshape(-1) for frame in frames])
        return Views(
            eyes_of([frame.camera for frame in frames], [frame.depth.shape for frame in frames]),
            wp.array(depth.astype(np.float32), dtype=float, device="cpu"),
            wp.array(np.concatenate(masks), dtype=wp.uint8, device="cpu"),
        )

    def votes(self, points: wp.array, voters: Sequence[int]) -> np.ndarray:
        """Return how many of the voters vote on each point, and how many for the object, (n, 2)."""
        found = wp.zeros((len(points), 2), dtype=int, device="cpu")
        inputs = [
            points,
            wp.array(np.array(voters, dtype=np.int32), dtype=int, device="cpu"),
            *(self.eyes, self.depth, self.masks, found),
        ]
        # One thread: all cores have frames of their own.
        launch_parallel(votes_kernel, len(points), inputs, threads=1)
        return found.numpy()


def _round(
    frames: Sequence[SmallDepth],
    views: Views,
    voters: Sequence[int],
    measured: Callable[[int], MeasuredPoints],
) -> list[MaskVotes]:
    centers = np.stack([frame.camera.center_world for frame in frames])

    def votes(number: int) -> MaskVotes:
        return _votes(frames[number], measured(number), views, _nearer(centers, number, voters))

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


def _votes(
    frame: SmallDepth, measured: MeasuredPoints, views: Views, others: Sequence[int]
) -> MaskVotes:
    rows, columns = measured.rows, measured.columns
    votes, for_object = views.votes(measured.points, others).T
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


def seen_through(
    frame: SmallDepth, rows: np.ndarray, columns: np.ndarray, others: Sequence[SmallDepth]
) -> np.ndarray:
    """Return at which pixels the object of the other masks may stand before what was measured, (n,) bool.

    Args:
        frame: with depth at all of the pixels.
        rows: of the pixels, (n,).
        columns: of the pixels, (n,).
        others: with masks.
    """
    depth = frame.depth[rows, columns].astype(np.float64)
    first = FIRST * float(np.nanmin(frame.depth))
    found = np.zeros(len(depth), dtype=bool)
    for share in np.linspace(0, 1, PLACES):
        place = first ** (1 - share) * np.maximum(first, LAST * depth) ** share
        points = unproject_pixels(rows, columns, place, frame.camera.intrinsics)
        found |= in_hull(transform_points(frame.camera.world_from_cam, points), others)
    return found


def in_hull(points: np.ndarray, others: Sequence[SmallDepth]) -> np.ndarray:
    """Return which points most of the views have in their masks, (n,) bool."""
    views, masks = np.zeros((2, len(points)))
    for other in others:
        assert other.mask is not None
        pixel, _ = pixels_showing(other.camera, points)
        inside = pixel >= 0
        views += inside
        masks += inside & other.mask.reshape(-1)[pixel]
    return (views >= FEWEST_VIEWS) & (masks >= IN_MASKS * views)
