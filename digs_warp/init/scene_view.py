"""One view of a whole scene -> voxels: measured surfaces, and guesses where nothing was measured."""

import time
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import Camera
from digs_warp.init.back_project import back_project
from digs_warp.init.config import InitConfig
from digs_warp.init.edges import smooth_depth
from digs_warp.init.view_points import thinned
from digs_warp.init.voxel import GrowingGrid, VoxelSums, voxel_keys

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

    @property
    def points(self) -> PointCloud:
        """One point per voxel."""
        return PointCloud(self.voxels.points_world, self.voxels.colors)

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


# What remains of the pixels, in this order.
SCENE_FILTERS = ("in view", "with depth", "away from edges")

# Guessed surfaces get grids coarser by this many levels than measured ones: more detail would be invented.
GUESS_COARSER = 1


@dataclass(frozen=True, eq=False)
class SceneView:
    """One view reduced to the grids.

    Attributes:
        camera: of the frame.
        measured: sums over pixels with depth, by the number of their grid.
        guessed: sums over pixels without depth, placed at the depth of the nearest pixel with depth.
        pixels: how many remained after each of `SCENE_FILTERS`.
        thinned_depth: every n-th row and column of the depth map, for the visibility check.
        seconds: CPU time [s].
    """

    camera: Camera
    measured: dict[int, VoxelSums]
    guessed: dict[int, VoxelSums]
    pixels: dict[str, int]
    thinned_depth: np.ndarray
    seconds: dict[str, float]


def scene_view(frame: Frame, config: InitConfig, levels: Levels) -> SceneView:
    """Back-project all pixels of one view and sum them per voxel.

    The edge filter (eq. 9) looks at inverse depth: on a floor that recedes, depth curves, inverse depth does
    not, and the noise of stereo is the same near and far.

    Args:
        frame: with image and depth.
        config: which filters.
        levels: which grid for which distance.
    """
    start = time.thread_time()
    image, depth = frame.load_image(), frame.load_depth()
    known = ~np.isnan(depth)
    keep = known & smooth_depth(1.0 / depth) if config.edge_filter else known
    measured = _on_levels(frame.camera, image, depth, keep, levels, 0)
    guess = nearest_known(depth)
    unknown = frame.load_unknown()
    unmeasured = ~known if unknown is None else ~(known | unknown)
    guessed = _on_levels(frame.camera, image, guess, unmeasured, levels, GUESS_COARSER)
    counts = (depth.size, int(np.count_nonzero(known)), int(np.count_nonzero(keep)))
    pixels: dict[str, int] = dict(zip(SCENE_FILTERS, counts, strict=True))
    seconds = {"views": time.thread_time() - start}
    return SceneView(frame.camera, measured, guessed, pixels, thinned(depth), seconds)


def nearest_known(depth: np.ndarray) -> np.ndarray:
    """Return the depth with each unknown value, NaN, replaced by that of the nearest known pixel.

    All of it stays NaN where nothing is known.
    """
    from scipy.ndimage import distance_transform_edt

    unknown = np.isnan(depth)
    if unknown.all() or not unknown.any():
        return depth
    places = distance_transform_edt(unknown, return_distances=False, return_indices=True)
    rows, columns = np.asarray(places)
    return depth[rows, columns]


@dataclass
class LevelSums:
    """Sums of many views on each grid."""

    grids: dict[int, GrowingGrid] = field(default_factory=lambda: defaultdict(GrowingGrid))

    def add(self, voxels: dict[int, VoxelSums]) -> None:
        """Add the voxels of one view."""
        for level, each in voxels.items():
            self.grids[level].add(each)

    def merged(self, levels: Levels) -> list[Grid]:
        """Return the sums of all views, from the finest grid to the coarsest."""
        return [Grid(levels.edge(n), self.grids[n].merged()) for n in sorted(self.grids)]


def _on_levels(
    camera: Camera,
    image: np.ndarray,
    depth: np.ndarray,
    keep: np.ndarray,
    levels: Levels,
    coarser: int,
) -> dict[int, VoxelSums]:
    keep = keep & ~np.isnan(depth)
    level = levels.of_depth(depth, camera.intrinsics.fx) + coarser
    found = np.flatnonzero(np.bincount(level[keep]))
    return {
        int(n): back_project(camera, image, depth, keep & (level == n), levels.edge(int(n)))
        for n in found
    }
