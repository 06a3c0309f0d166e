"""The equations of all pairs of frames, and the motions of the cameras that solve them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import warp as wp

from digs_warp.device.parallel import launch_parallel, packed
from digs_warp.poses.agreement import motions_of
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
from digs_warp.poses.views import View, arrays_of

if TYPE_CHECKING:
    from scipy.sparse import csc_array

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
        points: number of points that were compared.
    """

    matrices: np.ndarray
    sides: np.ndarray
    target_from_source: np.ndarray
    scales: Scales
    points: int


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
    """Return the damped matrix (6 n, 6 n) of n = ``count`` motions, without its zeros where they are many.

    It is the sum of blocks (k, 6, 6), each at the numbers of two motions, its row and its column.
    """
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
    return PairSums(matrices, found[:, SIDE : SIDE + 6], relative, scales, int(total[COLOR_COUNT]))


def adjoints_of(transforms: np.ndarray) -> np.ndarray:
    """Return what takes motions (turn, shift) in axes a to those in axes b, (k, 6, 6), for b_from_a."""
    rotations = transforms[:, :3, :3]
    adjoints = np.zeros((len(transforms), 6, 6))
    adjoints[:, :3, :3] = adjoints[:, 3:, 3:] = rotations
    columns = np.cross(transforms[:, None, :3, 3], np.swapaxes(rotations, 1, 2))
    adjoints[:, 3:, :3] = np.swapaxes(columns, 1, 2)
    return adjoints
