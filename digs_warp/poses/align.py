"""Poses of all frames at once, from nearly right ones: coarse to fine, each pair's color and depth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.geometry import laid_over, matrix_from_rotation_vector, rigid
from digs_warp.poses.equations import ANY_ERROR, PairComparison, solve
from digs_warp.poses.pairs import overlapping_pairs
from digs_warp.poses.views import Picture, view_of

# Sizes, each half of the next; steps at each; and the relative difference of depth that hides a point there:
# at first, poses are off by the slope of a surface over several pixels.
HIDDEN = (0.15, 0.1, 0.1)
STEPS = 10
# Steps below this are done [rad, or m at a distance of 1 m].
SMALL = 2e-5
# The smallest image that is worth a look [px].
LEAST_WIDTH = 40


@dataclass(frozen=True, eq=False)
class Alignment:
    """What the alignment found.

    Attributes:
        poses: ``world_from_cam``, (n, 4, 4), float64; as far from the given ones as they have to be: together
            they were not moved.
        error_before, error_after: mean difference of the images at the points, in units of the contrast.
        pairs: numbers (source, target) of the frames that were compared, (k, 2).
    """

    poses: np.ndarray
    error_before: float
    error_after: float
    pairs: np.ndarray


def align(pictures: Sequence[Picture], given: np.ndarray, threads: int = 0) -> Alignment | None:
    """Return poses with which the frames agree best; None if no two frames have enough in common.

    Gauss-Newton steps over the poses of all frames. Every pair compares the brightness and the inverse depth
    of the points of one frame with what the other measured: direct alignment, as in Kerl et al., "Dense
    visual SLAM for RGB-D cameras", IROS 2013, over all pairs at once.

    Args:
        pictures: of n frames, with depth.
        given: ``world_from_cam``, (n, 4, 4); errors of about one degree and a centimetre are mended.
        threads: that share the work; 0: as many as usual; 1 is faster for two frames.
    """
    pyramid = [list(pictures)]
    while len(pyramid) < len(HIDDEN) and pyramid[-1][0].intrinsics.width >= 2 * LEAST_WIDTH:
        pyramid.append([picture.halved() for picture in pyramid[-1]])
    pairs = overlapping_pairs(pyramid[-1], given)
    if not len(pairs):
        return None
    poses, error = given, (0.0, 0.0)
    for level, hidden in zip(reversed(pyramid), HIDDEN[-len(pyramid) :], strict=True):
        comparison = PairComparison([view_of(picture) for picture in level], pairs)
        before = comparison.sums(given, ANY_ERROR, hidden, threads).scales.color
        sums = comparison.sums(poses, ANY_ERROR, hidden, threads)
        for _ in range(STEPS):
            sums = comparison.sums(poses, sums.scales, hidden, threads)
            steps = solve(sums, pairs, len(given))
            poses = _moved(poses, steps)
            if np.abs(steps).max() < SMALL:
                break
        after = comparison.sums(poses, sums.scales, hidden, threads)
        error = (before, after.scales.color)
    return Alignment(in_place(poses, given, _distance(pictures)), *error, pairs)


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


def _moved(poses: np.ndarray, steps: np.ndarray) -> np.ndarray:
    motions = [rigid(matrix_from_rotation_vector(step[:3]), step[3:]) for step in steps]
    return poses @ np.stack(motions)
