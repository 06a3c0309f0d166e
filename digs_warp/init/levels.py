"""Grids whose edge lengths double, so that voxels grow with the distance from the cameras.

A pixel is summed on the grid whose voxels are as wide as a given number of pixels at its distance. Several
views of a surface fill several grids. The finest of them, that of the nearest view, shows the most detail;
the coarser voxels there are dropped.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.init.voxel import VoxelSums, voxel_keys

# No more grids than this: the coarsest has voxels 2048 times as large as the finest.
MOST_LEVELS = 12

# A voxel is dropped when finer ones cover this share of the surface in it. Where two grids meet, a coarse
# voxel is partly covered: dropping it would leave a gap, keeping it shows some of the surface twice.
COVERED = 0.5


@dataclass(frozen=True)
class Levels:
    """Which grid suits which distance.

    Attributes:
        finest: edge length of the finest grid [m].
        pixels: width of a voxel in pixels at its distance; None: the finest grid everywhere.
    """

    finest: float
    pixels: float | None

    def edge(self, level: int) -> float:
        """Return the edge length [m] of a grid."""
        return self.finest * 2.0**level

    def of_depth(self, depth: np.ndarray, focal: float) -> np.ndarray:
        """Return the number of the grid for each depth, int; NaN gets the finest.

        Args:
            depth: planar depth [m], any shape.
            focal: focal length of the camera [px].
        """
        if self.pixels is None:
            return np.zeros(depth.shape, dtype=np.int64)
        ratio = self.pixels / focal / self.finest * np.nan_to_num(depth, nan=0.0)
        return np.clip(np.rint(np.log2(np.maximum(ratio, 1.0))), 0, MOST_LEVELS - 1).astype(int)


@dataclass(frozen=True, eq=False)
class Grid:
    """The voxels of one grid, and their edge length [m]."""

    edge: float
    voxels: VoxelSums

    def coarser(self, factor: float) -> "Grid":
        """Return the sums on a grid whose edges are ``factor`` >= 1 times as long."""
        return Grid(factor * self.edge, self.voxels.coarser(factor * self.edge))

    def select(self, keep: np.ndarray) -> "Grid":
        """Return the voxels at ``keep``, a bool mask."""
        return Grid(self.edge, self.voxels.select(keep))

    def uncovered_by(self, others: Iterable["Grid"]) -> "Grid":
        """Return the voxels in which the ``others``, not coarser ones, cover less than `COVERED`."""
        share = np.zeros(len(self.voxels))
        for other in others:
            keys = voxel_keys(other.voxels.points_world, self.edge)
            places = np.searchsorted(self.voxels.keys, keys)
            inside = places < len(self.voxels)
            inside[inside] = self.voxels.keys[places[inside]] == keys[inside]
            covers = (other.edge / self.edge) ** 2  # of the surface in one of our voxels
            share += covers * np.bincount(places[inside], minlength=len(self.voxels))
        return self.select(share < COVERED)


def finest_of(grids: Sequence[Grid]) -> list[Grid]:
    """Return the grids, from the finest to the coarsest, without voxels that finer ones cover."""
    kept: list[Grid] = []
    for grid in grids:
        kept.append(grid.uncovered_by(kept))
    return kept


def count(grids: Iterable[Grid]) -> int:
    """Return the number of voxels on all grids."""
    return sum(len(grid.voxels) for grid in grids)
