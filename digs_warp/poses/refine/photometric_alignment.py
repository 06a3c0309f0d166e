"""Poses of all frames at once, from nearly right ones: coarse to fine, each pair's color and depth."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import warp as wp

from digs_warp.device.parallel import launch_parallel, packed
from digs_warp.device.threads import over_items
from digs_warp.geometry.rigid import invert_rigid, laid_over, matrix_from_rotation_vector, rigid
from digs_warp.poses.agreement import motions_of, overlapping_pairs
from digs_warp.poses.refine.alignment_kernel import (
    COLOR_COUNT,
    COLOR_SUM,
    COLUMNS,
    DEPTH_COUNT,
    DEPTH_SUM,
    SIDE,
    Limits,
    pair_kernel,
)
from digs_warp.poses.views import Picture, View, arrays_of, by_size, view_of

if TYPE_CHECKING:
    from scipy.sparse import csc_array

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


# Share of its diagonal that is added to an equation: nothing else holds a frame that sees little.
DAMPING = 1e-4
# Added as well: what a frame without a neighbor is held by.
LEAST_HOLD = 1e-9
# The scales of errors are at least this, so that perfect ones divide by something: [1], [1/m].
LEAST_COLOR, LEAST_DEPTH = 1e-3, 1e-5

# From this many unknowns on, zeros are left out of the work: those of 1,000 frames take 0.3 to 0.5 s then
# instead of 4 s, at every step. Fewer unknowns are solved as fast with all of them.
SPARSE_FROM = 120

_TRIANGLE = np.triu_indices(6)


@dataclass(frozen=True)
class Scales:
    """Means of the absolute errors: of the image (in units of its contrast), and of 1 / depth [1/m]."""

    color: float
    depth: float


# At first, every error counts.
ANY_ERROR = Scales(1.0, 0.05)


@dataclass(frozen=True, eq=False)
class PairSums:
    """What the pairs of frames say.

    Attributes:
        matrices: of the equations in a motion of the source, in the target's axes, (k, 6, 6): turn, shift.
        sides: right sides, (k, 6).
        target_from_source: (k, 4, 4).
        scales: of the errors of all pairs.
    """

    matrices: np.ndarray
    sides: np.ndarray
    target_from_source: np.ndarray
    scales: Scales


class PairComparison:
    """Compares pairs of views at given poses.

    Args:
        views: n, of one size or different ones.
        pairs: numbers of source and target, (k, 2).

    Attributes:
        pairs: as given.
    """

    def __init__(self, views: Sequence[View], pairs: np.ndarray) -> None:
        self.pairs = pairs
        self._arrays = arrays_of(views)

    def sums(self, poses: np.ndarray, scales: Scales, hidden: float, threads: int = 0) -> PairSums:
        """Return the equations of all pairs.

        Args:
            poses: ``world_from_cam``, (n, 4, 4).
            scales: errors as large as these count half.
            hidden: relative difference of depth from which on the target sees another surface.
            threads: that share the work; 0: as many as usual.
        """
        relative = motions_of(poses, self.pairs)
        found = wp.zeros((len(self.pairs), COLUMNS), dtype=wp.float64, device="cpu")
        limits = packed(Limits, color=scales.color, depth=scales.depth, hidden=hidden)
        sources, targets = (wp.array(each, dtype=int, device="cpu") for each in self.pairs.T)
        motions = wp.array(relative.astype(np.float32), dtype=wp.mat44, device="cpu")
        inputs = [sources, targets, motions, *self._arrays, limits, found]
        launch_parallel(pair_kernel, len(self.pairs), inputs, threads=threads)
        return _pair_sums(found.numpy(), relative)


def solve(sums: PairSums, pairs: np.ndarray, count: int) -> np.ndarray:
    """Return a small motion of each of ``count`` cameras in its own axes, turn [rad] and shift [m], (n, 6).

    A motion a of the source and b of the target move the source's points, in the target's axes, by
    Ad(target_from_source) a - b.
    """
    side = np.zeros((count, 6))
    moves = adjoints_of(sums.target_from_source)
    back = np.swapaxes(moves, 1, 2)
    sources, targets = pairs.T
    np.add.at(side, sources, np.einsum("kab,kb->ka", back, sums.sides))
    np.subtract.at(side, targets, sums.sides)
    across = back @ sums.matrices
    blocks = np.stack([across @ moves, sums.matrices, -across, -np.swapaxes(across, 1, 2)])
    rows, columns = (
        np.stack(each) for each in ((sources, targets) * 2, (sources, targets, targets, sources))
    )
    matrix = _damped(blocks.reshape(-1, 6, 6), rows.ravel(), columns.ravel(), count)
    return solution(matrix, side.reshape(-1)).reshape(-1, 6)


def _damped(
    blocks: np.ndarray, rows: np.ndarray, columns: np.ndarray, count: int
) -> "np.ndarray | csc_array":
    """Return the damped sum of blocks (k, 6, 6), each at its row and column of ``count`` motions."""
    if 6 * count < SPARSE_FROM:
        whole = np.zeros((count, count, 6, 6))
        np.add.at(whole, (rows, columns), blocks)
        square = whole.swapaxes(1, 2).reshape(6 * count, 6 * count)
        square[np.diag_indices(6 * count)] += DAMPING * np.diag(square) + LEAST_HOLD
        return square
    from scipy.sparse import coo_array, diags_array

    row, column = np.indices((6, 6))
    places = [
        (6 * numbers[:, None, None] + inside).reshape(-1)
        for numbers, inside in ((rows, row), (columns, column))
    ]
    sparse = coo_array((blocks.reshape(-1), tuple(places)), shape=(6 * count, 6 * count)).tocsc()
    return (sparse + diags_array(DAMPING * sparse.diagonal() + LEAST_HOLD)).tocsc()


def solution(matrix: "np.ndarray | csc_array", side: np.ndarray) -> np.ndarray:
    """Return what solves the equations of n motions, (6 n,).

    Args:
        matrix: symmetric and positive definite, (6 n, 6 n). With many frames, most of it is 0: a frame is
            compared with few others. From `SPARSE_FROM` unknowns on it may come without its zeros.
        side: right sides, (6 n,).
    """
    if isinstance(matrix, np.ndarray) and len(side) < SPARSE_FROM:
        return np.linalg.solve(matrix, side)
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    # What holds for positive definite matrices: the diagonal never has to be exchanged for stability.
    symmetric = {"SymmetricMode": True}
    factors = splu(
        csc_array(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric
    )
    return factors.solve(side)


def _pair_sums(found: np.ndarray, relative: np.ndarray) -> PairSums:
    matrices = np.zeros((len(found), 6, 6))
    matrices[:, _TRIANGLE[0], _TRIANGLE[1]] = found[:, :SIDE]
    matrices[:, _TRIANGLE[1], _TRIANGLE[0]] = found[:, :SIDE]
    total = found.sum(axis=0)
    color = total[COLOR_SUM] / max(total[COLOR_COUNT], 1.0)
    depth = total[DEPTH_SUM] / max(total[DEPTH_COUNT], 1.0)
    scales = Scales(max(LEAST_COLOR, float(color)), max(LEAST_DEPTH, float(depth)))
    return PairSums(matrices, found[:, SIDE : SIDE + 6], relative, scales)


def adjoints_of(transforms: np.ndarray) -> np.ndarray:
    """Return what takes motions (turn, shift) in axes a to those in axes b, (k, 6, 6), for b_from_a."""
    rotations = transforms[:, :3, :3]
    adjoints = np.zeros((len(transforms), 6, 6))
    adjoints[:, :3, :3] = adjoints[:, 3:, 3:] = rotations
    columns = np.cross(transforms[:, None, :3, 3], np.swapaxes(rotations, 1, 2))
    adjoints[:, 3:, :3] = np.swapaxes(columns, 1, 2)
    return adjoints


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
    found = _coarse_to_fine(pictures, levels, given, threads=1)  # one is faster for two
    return second_from_first if found is None else invert_rigid(found.poses[1]) @ found.poses[0]


def _coarse_to_fine(
    pictures: Sequence[Sequence[Picture]],
    levels: Iterable[Sequence[View]],
    given: np.ndarray,
    threads: int = 0,
) -> Alignment | None:
    """Align all frames from small to large; each level of views may be made when it is asked for."""
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
