"""Poses of all frames at once, from nearly right ones: coarse to fine, each pair's color and depth."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.device.threads import over_items
from digs_warp.geometry.rigid import invert_rigid, laid_over, matrix_from_rotation_vector, rigid
from digs_warp.poses.covisibility import overlapping_pairs
from digs_warp.poses.refine.normal_equations import ANY_ERROR, PairComparison, solve
from digs_warp.poses.views import Picture, View, by_size, view_of

# Sizes, each half of the next; steps at each; and the relative difference of depth that hides a point there:
# at first, poses are off by the slope of a surface over several pixels.
HIDDEN = (0.15, 0.1, 0.1)
STEPS = 10
# Steps below this are done [rad, or m at a distance of 1 m].
SMALL = 2e-5
# The smallest image that is worth a look [px]. In smaller ones all frames at once run away (those of a room
# by 20 cm in 67 columns); two do not, and find motions from farther off.
LEAST_WIDTH, LEAST_WIDTH_OF_TWO = 80, 40
# Poses are judged in images of at most this width [px]: in larger ones a wrong pose is off by more pixels,
# and so are the poses that the noise of the depth asks for.
JUDGED = 320


@dataclass(frozen=True, eq=False)
class Alignment:
    """What the alignment found.

    Attributes:
        poses: ``world_from_cam``, (n, 4, 4), float64; as far from the given ones as they have to be: together
            they were not moved.
        error_before, error_after: mean difference of the images at the points, in units of the contrast, in
            images of at most `JUDGED` columns.
        pairs: numbers (source, target) of the frames that were compared, (k, 2).
    """

    poses: np.ndarray
    error_before: float
    error_after: float
    pairs: np.ndarray


def align(pictures: Sequence[Picture], given: np.ndarray) -> Alignment | None:
    """Return poses with which the frames agree best; None if no two frames have enough in common.

    Gauss-Newton steps over the poses of all frames. Every pair compares the brightness and the inverse depth
    of the points of one frame with what the other measured: direct alignment, as in Kerl et al., "Dense
    visual SLAM for RGB-D cameras", IROS 2013, over all pairs at once.

    Args:
        pictures: of n frames, with depth.
        given: ``world_from_cam``, (n, 4, 4); errors of about one degree and a centimetre are mended.
    """
    levels = by_size([each.sizes(len(HIDDEN), LEAST_WIDTH) for each in pictures])
    views = (over_items(level, view_of) for level in levels)
    return _coarse_to_fine(levels, views, given)


def pyramid_of(picture: Picture) -> tuple[View, ...]:
    """Return a picture at the sizes at which it is aligned, the smallest first, for `align_pair`."""
    return tuple(view_of(each) for each in picture.sizes(len(HIDDEN), LEAST_WIDTH_OF_TWO))


def align_pair(
    first: Sequence[View], second: Sequence[View], second_from_first: np.ndarray
) -> np.ndarray:
    """Return the motion between two frames after `align`; the same where they have nothing in common.

    Args:
        first: `pyramid_of` a frame.
        second: that of the other.
        second_from_first: (4, 4).
    """
    levels = by_size([first, second])
    given = np.stack([np.eye(4), invert_rigid(second_from_first)])
    pictures = [[view.picture for view in level] for level in levels]
    found = _coarse_to_fine(pictures, levels, given, threads=1)
    return second_from_first if found is None else invert_rigid(found.poses[1]) @ found.poses[0]


def _coarse_to_fine(
    pictures: Sequence[Sequence[Picture]],
    levels: Iterable[Sequence[View]],
    given: np.ndarray,
    threads: int = 0,
) -> Alignment | None:
    """Align all frames from small to large; each level of views may be made when it is asked for.

    One thread is faster for two frames.
    """
    pairs = overlapping_pairs(pictures[0], given)
    if not len(pairs):
        return None
    poses, judge = given, None
    for views, hidden in zip(levels, HIDDEN[-len(pictures) :], strict=True):
        comparison = PairComparison(views, pairs)
        if judge is None or views[0].picture.intrinsics.width <= JUDGED:
            judge = comparison, hidden
        poses = _descended(comparison, poses, hidden, threads)
    assert judge is not None
    before, after = (
        judge[0].sums(each, ANY_ERROR, judge[1], threads).scales.color for each in (given, poses)
    )
    return Alignment(in_place(poses, given, _distance(pictures[-1])), before, after, pairs)


def _descended(
    comparison: PairComparison, poses: np.ndarray, hidden: float, threads: int
) -> np.ndarray:
    """Return the poses after Gauss-Newton steps."""
    sums = comparison.sums(poses, ANY_ERROR, hidden, threads)
    for _ in range(STEPS):
        sums = comparison.sums(poses, sums.scales, hidden, threads)
        steps = solve(sums, comparison.pairs, len(poses))
        poses = stepped(poses, steps)
        if np.abs(steps).max() < SMALL:
            break
    return poses


def in_place(poses: np.ndarray, given: np.ndarray, distance: float) -> np.ndarray:
    """Return the poses after the rigid motion of all that lays them over the given ones (Kabsch).

    Over each other lie the centers and points ``distance`` [m] away along each camera's axes.
    """
    return laid_over(_marks(poses, distance), _marks(given, distance)) @ poses


def _marks(poses: np.ndarray, distance: float) -> np.ndarray:
    centers = poses[:, :3, 3]
    return np.concatenate([centers, *(centers + distance * poses[:, :3, i] for i in range(3))])


def _distance(pictures: Sequence[Picture]) -> float:
    """Return a usual distance of what the frames see [m]: the harmonic mean, for near things count most."""
    return float(
        1 / np.nanmean([np.nanmean(1 / p.depth) for p in pictures if np.isfinite(p.depth).any()])
    )


def stepped(poses: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Return the poses after a turn [rad] and a shift [m] of each camera in its own axes, (n, 6)."""
    motions = [rigid(matrix_from_rotation_vector(step[:3]), step[3:]) for step in steps]
    return poses @ np.stack(motions)
