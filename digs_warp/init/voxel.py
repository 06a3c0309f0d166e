"""Voxel-grid filter: one point per occupied voxel, at the mean of its measurements (paper eq. 10).

Every view sees the same surface again; the grid merges many noisy measurements of a spot into one point.
The grid is anchored at the world's origin, so the sums of separate batches can be merged: a recording is
reduced view by view and never held in memory as a whole.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.checks import DigsError, check_positive
from digs_warp.data.point_cloud import PointCloud

# Three signed voxel indices share one 64-bit key, so that a single sort groups the points.
BITS = 21
MAX_INDEX = 2 ** (BITS - 1) - 1

POSITION, COLOR, COLUMNS = 1, 4, 7  # where each begins in a row of sums, and how many there are

# A voxel is dropped when finer ones cover this share of the surface in it. Where two grids meet, a coarse
# voxel is partly covered: dropping it would leave a gap, keeping it shows some of the surface twice.
COVERED = 0.5


@dataclass(frozen=True, eq=False)
class Voxels:
    """The accumulated measurements of each occupied voxel of a grid.

    Attributes:
        edge: edge length [m].
        keys: packed voxel indices, ascending, shape (n,), int64.
        sums: number of measurements, summed positions [m] and summed colors in 0..1, shape (n, 1 + 6),
            float64.
    """

    edge: float
    keys: np.ndarray
    sums: np.ndarray

    def __len__(self) -> int:
        return len(self.keys)

    @property
    def points_world(self) -> np.ndarray:
        """Mean positions [m], shape (n, 3), in the order of the keys."""
        return self.sums[:, POSITION:COLOR] / self.sums[:, :1]

    @property
    def points(self) -> PointCloud:
        """One point per voxel."""
        return PointCloud(self.points_world, self.sums[:, COLOR:] / self.sums[:, :1])

    def select(self, keep: np.ndarray) -> "Voxels":
        """Return the voxels at ``keep``, a bool mask."""
        return Voxels(self.edge, self.keys[keep], self.sums[keep])

    def coarser(self, factor: float) -> "Voxels":
        """Return the sums on a grid whose edges are ``factor`` >= 1 times as long.

        A voxel's mean position decides where it goes.

        Raises:
            DigsError: the edge is so small that voxel indices overflow.
        """
        if factor == 1:
            return self
        edge = factor * self.edge
        return sums_by_key(edge, voxel_keys(self.points_world, edge), self.sums)

    def moved(self, points_world: np.ndarray) -> "Voxels":
        """Return the sums with other mean positions [m], (n, 3); those in one voxel are joined."""
        sums = self.sums.copy()
        sums[:, POSITION:COLOR] = points_world * sums[:, :1]
        return sums_by_key(self.edge, voxel_keys(points_world, self.edge), sums)

    def uncovered_by(self, others: Iterable["Voxels"]) -> "Voxels":
        """Return the voxels in which the ``others``, not coarser ones, cover less than `COVERED`."""
        share = np.zeros(len(self))
        for other in others:
            keys = voxel_keys(other.points_world, self.edge)
            places = np.searchsorted(self.keys, keys)
            inside = places < len(self)
            inside[inside] = self.keys[places[inside]] == keys[inside]
            covers = (other.edge / self.edge) ** 2  # of the surface in one of our voxels
            share += covers * np.bincount(places[inside], minlength=len(self))
        return self.select(share < COVERED)


def merged(batches: Sequence[Voxels]) -> Voxels:
    """Return the sums of several batches (at least one) on the same grid."""
    keys = np.concatenate([batch.keys for batch in batches])
    return sums_by_key(batches[0].edge, keys, np.concatenate([batch.sums for batch in batches]))


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


def sums_by_key(edge: float, keys: np.ndarray, rows: np.ndarray) -> Voxels:
    """Return the sums of rows, (n, 1 + 6), with the same key, (n,)."""
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    first = np.flatnonzero(np.diff(keys, prepend=keys[:1] - 1))
    return Voxels(edge, keys[first], np.add.reduceat(rows[order], first, axis=0))
