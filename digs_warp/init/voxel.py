"""Voxel-grid filter: one point per occupied voxel, at the mean of what fell into it (paper eq. 10).

Every view sees the same surface again; the grid turns many noisy measurements of a spot into one
point. The grid is anchored at the world's origin, so sums of separate batches can be merged: a
recording is reduced view by view and never held in memory as a whole.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.checks import DigsError, check_positive
from digs_warp.point_cloud import PointCloud

# Three signed voxel indices share one 64-bit key, so that a single sort groups the points.
_BITS = 21
MAX_INDEX = 2 ** (_BITS - 1) - 1


@dataclass(frozen=True, eq=False)
class VoxelSums:
    """What fell into each occupied voxel so far.

    Attributes:
        keys: packed voxel indices, ascending, shape (n,), int64.
        counts: points in the voxel, shape (n,), int64.
        sums: summed positions [m] and colours, shape (n, 6), float64.
    """

    keys: np.ndarray
    counts: np.ndarray
    sums: np.ndarray

    def __len__(self) -> int:
        return len(self.keys)

    def well_supported(self, fraction: float) -> "VoxelSums":
        """Return the voxels with at least ``fraction`` of the median number of points."""
        if len(self) == 0:
            return self
        keep = self.counts >= fraction * np.median(self.counts)
        return VoxelSums(self.keys[keep], self.counts[keep], self.sums[keep])

    def mean_points(self) -> PointCloud:
        """Return the mean position and colour of each voxel, in the order of the keys."""
        means = self.sums / self.counts[:, None]
        return PointCloud(means[:, :3], means[:, 3:])


def voxel_sums(points_world: np.ndarray, colors: np.ndarray, voxel_size: float) -> VoxelSums:
    """Sum up points, shape (n, 3) [m], and their colours, shape (n, 3), per voxel of the grid.

    Raises:
        DigsError: the voxel size is not positive, or so small that voxel indices overflow.
    """
    keys = _voxel_keys(points_world, voxel_size)
    rows = np.concatenate([points_world, colors], axis=1, dtype=np.float64)
    return _sum_by_key(keys, np.ones(len(keys), dtype=np.int64), rows)


def merge_voxel_sums(batches: Sequence[VoxelSums]) -> VoxelSums:
    """Return the sums of several batches (at least one) on the same grid."""
    return _sum_by_key(
        np.concatenate([batch.keys for batch in batches]),
        np.concatenate([batch.counts for batch in batches]),
        np.concatenate([batch.sums for batch in batches]),
    )


def voxel_downsample(points: PointCloud, voxel_size: float) -> PointCloud:
    """Return one point per occupied voxel with edge length ``voxel_size`` [m]."""
    return voxel_sums(points.points_world, points.colors, voxel_size).mean_points()


def _voxel_keys(points_world: np.ndarray, voxel_size: float) -> np.ndarray:
    check_positive("voxel size", voxel_size)
    extent = float(np.abs(points_world).max(initial=0.0))
    if not extent / voxel_size < MAX_INDEX:
        raise DigsError(
            f"voxel size {voxel_size:g} m: too small for points up to {extent:g} m from the origin, "
            f"expected at least {extent / MAX_INDEX:.2g} m; choose a larger voxel size"
        )
    keys = np.zeros(len(points_world), dtype=np.int64)
    for coordinate in np.asarray(points_world, dtype=np.float64).T:
        index = np.floor(coordinate / voxel_size).astype(np.int64) + MAX_INDEX + 1
        keys = (keys << _BITS) | index
    return keys


def _sum_by_key(keys: np.ndarray, counts: np.ndarray, rows: np.ndarray) -> VoxelSums:
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    first = np.flatnonzero(np.diff(keys, prepend=keys[:1] - 1))
    sums = np.add.reduceat(rows[order], first, axis=0)
    return VoxelSums(keys[first], np.add.reduceat(counts[order], first), sums)
