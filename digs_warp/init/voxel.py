"""Voxel-grid filter: one point per occupied voxel, at the mean of its measurements (paper eq. 10).

Every view sees the same surface again; the grid merges many noisy measurements of a spot into one point.
The grid is anchored at the world's origin, so the sums of separate batches can be merged: a recording is
reduced view by view and never held in memory as a whole.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.checks import DigsError, check_positive

# Three signed voxel indices share one 64-bit key, so that a single sort groups the points.
BITS = 21
MAX_INDEX = 2 ** (BITS - 1) - 1

POSITION, COLOR, VALUES = 0, 3, 6  # where each begins in a row of sums, and how many they are

# New views are collected until together they have this many times the grid's voxels, then merged.
MERGE_AT = 3.0


@dataclass(frozen=True, eq=False)
class VoxelSums:
    """The accumulated measurements of each occupied voxel.

    Attributes:
        keys: packed voxel indices, ascending, shape (n,), int64.
        sums: number of measurements, summed positions [m] and summed colors in 0..1, shape (n, 1 + 6),
            float64.
    """

    keys: np.ndarray
    sums: np.ndarray

    def __len__(self) -> int:
        return len(self.keys)

    @property
    def means(self) -> np.ndarray:
        """Means of position and color, shape (n, 6)."""
        return self.sums[:, 1:] / self.sums[:, :1]

    @property
    def points_world(self) -> np.ndarray:
        """Mean positions [m], shape (n, 3), in the order of the keys."""
        return self.means[:, POSITION:COLOR]

    @property
    def colors(self) -> np.ndarray:
        """Mean colors, shape (n, 3)."""
        return self.means[:, COLOR:]

    def select(self, keep: np.ndarray) -> "VoxelSums":
        """Return the voxels at ``keep``, a bool mask."""
        return VoxelSums(self.keys[keep], self.sums[keep])

    def coarser(self, voxel_size: float) -> "VoxelSums":
        """Return the sums on a coarser grid [m]; a voxel's mean position decides where it goes.

        Raises:
            DigsError: the voxel size is not positive, or so small that voxel indices overflow.
        """
        return _sum_by_key(voxel_keys(self.points_world, voxel_size), self.sums)

    def moved(self, points_world: np.ndarray, voxel_size: float) -> "VoxelSums":
        """Return the sums with other mean positions [m], (n, 3), on a grid; those in one voxel are joined."""
        sums = self.sums.copy()
        first = 1 + POSITION
        sums[:, first : first + 3] = points_world * sums[:, :1]
        return _sum_by_key(voxel_keys(points_world, voxel_size), sums)


class GrowingGrid:
    """Voxel sums of many views.

    New views are collected until together they outweigh the grid, then merged. So each voxel is sorted a
    logarithmic number of times, and memory stays within a few times the grid.
    """

    def __init__(self) -> None:
        self._batches: list[VoxelSums] = []

    def add(self, voxels: VoxelSums) -> None:
        """Add the sums of one view."""
        self._batches.append(voxels)
        if sum(map(len, self._batches[1:])) > MERGE_AT * len(self._batches[0]):
            self._batches = [self.merged()]

    def merged(self) -> VoxelSums:
        """Return the sums of all views; needs at least one."""
        return merge_voxel_sums(self._batches)


def merge_voxel_sums(batches: Sequence[VoxelSums]) -> VoxelSums:
    """Return the sums of several batches (at least one) on the same grid."""
    return _sum_by_key(
        np.concatenate([batch.keys for batch in batches]),
        np.concatenate([batch.sums for batch in batches]),
    )


def voxel_keys(points_world: np.ndarray, voxel_size: float) -> np.ndarray:
    """Return the packed voxel index of each point [m], shape (n,), int64.

    Raises:
        DigsError: the voxel size is not positive, or so small that voxel indices overflow.
    """
    check_positive("voxel size", voxel_size)
    extent = float(np.abs(points_world).max(initial=0.0))
    if not extent / voxel_size < MAX_INDEX:
        raise DigsError(
            f"voxel size {voxel_size:g} m: too small for points up to {extent:g} m from the origin, "
            f"expected at least {extent / MAX_INDEX:.2g} m; choose a larger voxel size"
        )
    keys = np.zeros(len(points_world), dtype=np.int64)
    # The kernel also multiplies by the reciprocal, so both assign a point to the same voxel.
    voxels_per_metre = 1.0 / voxel_size
    for coordinate in np.asarray(points_world, dtype=np.float64).T:
        index = np.floor(coordinate * voxels_per_metre).astype(np.int64) + MAX_INDEX + 1
        keys = (keys << BITS) | index
    return keys


def _sum_by_key(keys: np.ndarray, rows: np.ndarray) -> VoxelSums:
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    first = np.flatnonzero(np.diff(keys, prepend=keys[:1] - 1))
    sums = np.add.reduceat(rows[order], first, axis=0)
    return VoxelSums(keys[first], sums)
