"""Poses and the distances of points together: photometric bundle adjustment.

An alignment that takes measured depth for true is as wrong as the depth: the errors of a stereo camera are
those of whole regions and do not average out. Here the distance of every point is unknown as well. Given
poses hold what images leave open, as far as they can be relied on. The residuals are those of Engel et al.,
"Direct sparse odometry", PAMI 2018, with images without their exposure in place of patches.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from digs_warp.device.parallel import launch_parallel, packed
from digs_warp.geometry.rigid import invert_rigid
from digs_warp.poses import thresholds
from digs_warp.poses.agreement import disagreement, measured_pairs, motions_of
from digs_warp.poses.refine.bundle_adjustment_kernel import (
    Block,
    Bundle,
    Motion,
    nearness_kernel,
    sum_kernel,
)
from digs_warp.poses.refine.photometric_alignment import (
    DAMPING,
    LEAST_COLOR,
    adjoints_of,
    solution,
    stepped,
)
from digs_warp.poses.views import Picture, View, arrays_of, by_size, view_of

# Points of a frame: distances that are right make up for fewer of them.
POINTS = 1500
# Images of half the size come first: they converge from farther.
SIZES = 2
STEPS = 20
# Share of the last step that is taken again: the noise of the images makes single steps too short.
MOMENTUM = 0.6
# Steps below this are done [rad, or m at a distance of 1 m].
SMALL = 3e-5
# The first residual that counts half, in units of the contrast.
FIRST_COLOR = 0.3
# A target that measures another depth than a point's, by this share, sees another surface.
HIDDEN = 0.05
# By how much a step changes the distance of a point at most, as a share; and what is expected of it at first.
LARGEST_CHANGE, EXPECTED = 0.02, 1.0
# Given poses are not relied on by more than this [rad; m at a distance of 1 m].
LEAST_ERROR = 1e-4
# By how much the scale of depth is usually wrong: half of a percent with a drifted stereo camera.
DEPTH_SCALE = 0.005


def adjusted_where_better(
    pictures: Sequence[Picture],
    small: Sequence[Picture],
    pairs: np.ndarray,
    poses: np.ndarray,
    given: np.ndarray,
) -> np.ndarray:
    """Return the poses after `adjusted`, or as they are if color and depth then agree clearly less.

    Where little has texture, images leave too much open, and depth tells more. An alignment also fits the
    errors of the depth, so that a little less agreement says nothing. ``small``: the same pictures after
    `digs_warp.poses.agreement.reduced`; the other arguments as of `adjusted`.
    """
    found = adjusted(pictures, pairs, poses, given)
    after, before = (
        np.mean(measured_pairs(disagreement, small, each, pairs)) for each in (found, poses)
    )
    return found if after < thresholds.MAX_ADJUSTED_RATIO * before else poses


def adjusted(
    pictures: Sequence[Picture], pairs: np.ndarray, poses: np.ndarray, given: np.ndarray
) -> np.ndarray:
    """Return the poses under which the images agree best, whatever the distances, (n, 4, 4).

    Gauss-Newton steps; the distances are eliminated from the equations. The error of the given poses is
    taken from how far the alignment moved them.

    Args:
        pictures: of n frames; the points are those with measured depth.
        pairs: numbers (source, target) of the frames that are compared, sorted, (k, 2).
        poses: ``world_from_cam`` to start from, (n, 4, 4): off by two pixels at most, as after `align`.
        given: the poses as they were given, (n, 4, 4).
    """
    before = motions_between(given, poses)
    errors = np.maximum(np.sqrt((before.reshape(-1, 2, 3) ** 2).mean(axis=(0, 2))), LEAST_ERROR)
    trust = np.repeat(errors**-2, 3)
    for sized in by_size([picture.sizes(SIZES) for picture in pictures]):
        adjustment = Adjustment([view_of(each, POINTS) for each in sized], pairs)
        poses = adjustment.of(poses, given, trust)
        # The distances as they are now say what scale the measured depth has.
        poses = in_likely_scale(_scaled(poses, adjustment.depth_scale), given)
    return poses


class Adjustment:
    """The equations of views of one size, and how near their points are.

    Args:
        views: n, with m points in all.
        pairs: numbers (source, target) of the views that are compared, sorted, (k, 2).

    Attributes:
        nearer: logarithm of the measured distance of each point over the one it has now, (m,), float32.
    """

    def __init__(self, views: Sequence[View], pairs: np.ndarray) -> None:
        self._pairs = pairs
        self._begins = np.searchsorted(pairs[:, 0], np.arange(len(views) + 1)).astype(np.int32)
        counts = np.diff(self._begins)
        self._blocks = np.cumsum([0, *(counts * (counts + 1) // 2)]).astype(np.int32)
        self.nearer = np.zeros(sum(len(view.points) for view in views), np.float32)
        names = ("starts", "points", "values", "frames", "image", "depth")
        self._fixed = dict(zip(names, arrays_of(views), strict=True)) | {
            "begins": wp.array(self._begins, dtype=int, device="cpu"),
            "targets": wp.array(pairs[:, 1].astype(np.int32), dtype=int, device="cpu"),
        }

    @property
    def depth_scale(self) -> float:
        """What measured depth has to be divided by, to fit the poses."""
        return float(np.exp(np.median(self.nearer))) if len(self.nearer) else 1.0

    def of(self, poses: np.ndarray, given: np.ndarray, trust: np.ndarray) -> np.ndarray:
        """Return the poses after all steps; ``trust``: inverse variance of the given ones, (6,)."""
        color, last = FIRST_COLOR, np.zeros((len(poses), 6))
        for _ in range(STEPS):
            system = self.system(poses, color)
            matrix, side, color = self.equations(system)
            steps = solved(matrix, side, motions_between(given, poses), trust) + MOMENTUM * last
            self.move_points(system, steps)
            poses, last = stepped(poses, steps), steps
            if np.abs(steps).max() < SMALL:
                break
        return poses

    def system(self, poses: np.ndarray, color: float) -> Any:
        """Return what the kernels read; ``color``: the residual that counts half."""
        relative = motions_of(poses, self._pairs)
        self._adjoints = adjoints_of(relative)
        return packed(
            Bundle,
            **self._fixed,
            target_from_source=wp.array(relative.astype(np.float32), dtype=wp.mat44, device="cpu"),
            nearer=wp.array(self.nearer, dtype=float, device="cpu"),
            color=color,
            hidden=HIDDEN,
            held=EXPECTED**-2,
            usual=float(self.nearer.mean()) if len(self.nearer) else 0.0,
        )

    def equations(self, system: Any) -> tuple[np.ndarray, np.ndarray, float]:
        """Return the matrix (n, 6, n, 6) and right sides (n, 6) of all motions, and the mean residual."""
        frames, pairs = len(self._begins) - 1, len(self._pairs)
        scratch, sides = (wp.zeros(pairs, dtype=Motion, device="cpu") for _ in range(2))
        matrices = wp.zeros(int(self._blocks[-1]), dtype=Block, device="cpu")
        errors = wp.zeros((frames, 2), dtype=wp.float64, device="cpu")
        blocks = wp.array(self._blocks[:-1], dtype=int, device="cpu")
        launch_parallel(sum_kernel, frames, [system, blocks, scratch, matrices, sides, errors])
        matrix, side = np.zeros((frames, 6, frames, 6)), np.zeros((frames, 6))
        for frame in range(frames):
            self._add(frame, matrices.numpy(), sides.numpy(), matrix, side)
        total, number = errors.numpy().sum(axis=0)
        return matrix, side, max(LEAST_COLOR, float(total / max(number, 1.0)))

    def _add(
        self,
        frame: int,
        matrices: np.ndarray,
        sides: np.ndarray,
        matrix: np.ndarray,
        side: np.ndarray,
    ) -> None:
        """Add the equations of a frame's points to those of all motions.

        Its motion a and a target's b move the points, in the target's axes, by Ad(target_from_source) a - b.
        Sums, not products of matrices: those depend on the number of threads.
        """
        pairs = slice(self._begins[frame], self._begins[frame + 1])
        targets, moved, own = self._pairs[pairs, 1], self._adjoints[pairs], sides[pairs]
        a, b = np.tril_indices(len(targets))
        blocks = np.zeros((len(targets), len(targets), 6, 6))
        blocks[a, b] = matrices[self._blocks[frame] : self._blocks[frame + 1]]
        blocks[b, a] = np.swapaxes(blocks[a, b], 1, 2)
        across = np.einsum("aji,abjk->bik", moved, blocks)
        matrix[frame, :, frame] += np.einsum("bik,bkl->il", across, moved)
        side[frame] += np.einsum("aji,aj->i", moved, own)
        side[targets] -= own
        for number, target in enumerate(targets):
            matrix[frame, :, target] -= across[number]
            matrix[target, :, frame] -= across[number].T
            matrix[target][:, targets] += np.swapaxes(blocks[number], 0, 1)

    def move_points(self, system: Any, steps: np.ndarray) -> None:
        """Move the points to where they fit best after a motion of each camera, (n, 6)."""
        moves = np.einsum("kab,kb->ka", self._adjoints, steps[self._pairs[:, 0]])
        relative = wp.array(moves - steps[self._pairs[:, 1]], dtype=Motion, device="cpu")
        moved = wp.zeros(len(self.nearer), dtype=float, device="cpu")
        inputs = [system, relative, LARGEST_CHANGE, moved]
        launch_parallel(nearness_kernel, len(self._begins) - 1, inputs)
        self.nearer = moved.numpy()


def solved(
    matrix: np.ndarray, side: np.ndarray, moved: np.ndarray, trust: np.ndarray
) -> np.ndarray:
    """Return a motion of each camera, (n, 6); ``moved``: how far each is from its given pose, (n, 6)."""
    count = len(side)
    square = matrix.reshape(6 * count, 6 * count)
    square[np.diag_indices(6 * count)] += DAMPING * np.diag(square) + np.tile(trust, count)
    return solution(square, (side - trust * moved).reshape(-1)).reshape(count, 6)


def motions_between(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return the turn [rad] and shift [m] of each camera in its axes after it moved, (n, 6)."""
    from scipy.spatial.transform import Rotation

    moved = np.stack([invert_rigid(a) @ b for a, b in zip(before, after, strict=True)])
    turns = Rotation.from_matrix(moved[:, :3, :3]).as_rotvec()
    shifts = np.einsum("nji,nj->ni", moved[:, :3, :3], moved[:, :3, 3])
    return np.concatenate([turns, shifts], axis=1)


def _scaled(poses: np.ndarray, scale: float) -> np.ndarray:
    """Return the poses with their centers farther apart by a factor."""
    scaled, middle = poses.copy(), poses[:, :3, 3].mean(axis=0)
    scaled[:, :3, 3] = middle + scale * (poses[:, :3, 3] - middle)
    return scaled


def in_likely_scale(poses: np.ndarray, given: np.ndarray) -> np.ndarray:
    """Return the poses with their centers farther apart or closer together, as the given ones say.

    Refined poses have the scale of the depth. The given centers have one as well, which errors of single
    poses hardly change if there are many around an object, and which says nothing on a short arc. Each counts
    by the inverse of its variance.

    Args:
        poses: refined, (n, 4, 4).
        given: the same as they were, on which the refined ones lie as well as a rigid motion can.
    """
    middle = poses[:, :3, 3].mean(axis=0)
    own, before = poses[:, :3, 3] - middle, given[:, :3, 3] - given[:, :3, 3].mean(axis=0)
    extent, known = float((own**2).sum()), 3 * len(poses) - 7
    if known <= 0 or extent == 0:
        return poses
    larger = float((own * before).sum()) / extent - 1
    variance = float(((before - (1 + larger) * own) ** 2).sum()) / known / extent
    scaled = poses.copy()
    scaled[:, :3, 3] += larger * DEPTH_SCALE**2 / (DEPTH_SCALE**2 + variance) * own
    return scaled
