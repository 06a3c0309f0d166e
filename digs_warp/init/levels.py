"""Grids of voxels whose edge lengths double: which one suits which distance, and how many voxels there are.

On and around an object, surfaces are at one distance: one grid suits all of them. In a scene they are at all
distances, and voxels grow with the distance. By default a voxel is as large as two pixels there: what the
images resolve, for a cup and for a car.
"""

import logging
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.config import InitConfig
from digs_warp.init.start import Subject
from digs_warp.init.strategies import FINE_PIXELS
from digs_warp.init.voxel import GrowingGrid, VoxelSums, voxel_keys

logger = logging.getLogger(__name__)

# No more grids than this: the coarsest has voxels 2048 times as large as the finest.
MOST_LEVELS = 12

# A voxel is dropped when finer ones cover this share of the surface in it. Where two grids meet, a coarse
# voxel is partly covered: dropping it would leave a gap, keeping it shows some of the surface twice.
COVERED = 0.5

# Views that tell how large a pixel is at the object, or how near the surfaces of a scene are; of scenes every
# n-th row and column. The finest grid of a scene suits this percentile of the depths: what is nearer gets the
# same voxels.
LOOKED_AT, LOOKED_AT_IN_SCENE, STRIDE = 8, 16, 4
NEAREST_PERCENTILE = 2.0

# More points than this are never wanted by default: a step of the training takes too long on a CPU.
MOST_POINTS = 200_000

# The search for the edge lengths that give a number of points begins this close to it, and ends after some
# steps.
CLOSE, MOST_STEPS = 0.97, 8

# The object's box ignores this percentage of the voxels at either end of each axis.
BOX_PERCENTILE = 0.5


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


def chosen_levels(
    frames: Sequence[Frame], config: InitConfig, subject: Subject, sfm_per_metre: float | None
) -> Levels:
    """Return the grids on which the views are summed.

    Raises:
        DigsError: a size in units of structure from motion, but no scale; or as a share of a scene.
    """
    is_object = subject == "object"
    if config.voxel_unit == "object" and not is_object:
        raise DigsError("voxel_unit object: a whole scene has no object to measure; choose metre")
    edge, is_coarsened = config.voxel_edge, config.voxel_unit == "object" or config.target_points
    if edge is None or is_coarsened:  # after all views were added
        pixels = FINE_PIXELS if is_coarsened else config.voxel_pixels
        width = _pixel_at_object(frames, config.mask_level) if is_object else _near_pixel(frames)
        return Levels(pixels * width, None if is_object else pixels)
    if config.voxel_unit == "metre":
        return Levels(edge, None)
    if sfm_per_metre is None:
        raise DigsError(
            "voxel_unit sfm: needs structure from motion (--poses sfm); with the recorded poses choose "
            "metre or object"
        )
    return Levels(edge / sfm_per_metre, None)


def _pixel_at_object(frames: Sequence[Frame], mask_level: int) -> float:
    """Return the width [m] of a pixel at the object: the median over a few views that show it."""
    sizes = []
    for number in range(0, len(frames), max(1, len(frames) // LOOKED_AT)):
        frame = frames[number]
        depth = frame.load_depth()[frame.load_mask() > mask_level]
        depth = depth[~np.isnan(depth)]
        if depth.size:
            sizes.append(float(np.median(depth)) / frame.camera.intrinsics.fx)
    # Without an object pixel the views will raise the error.
    return float(np.median(sizes)) if sizes else 1.0


def _near_pixel(frames: Sequence[Frame]) -> float:
    """Return the width [m] of a pixel at the nearest surfaces of a scene."""
    pixels = []
    for frame in frames[:: max(1, len(frames) // LOOKED_AT_IN_SCENE)]:
        depth = frame.load_depth()[::STRIDE, ::STRIDE]
        pixels.append(depth[~np.isnan(depth)] / frame.camera.intrinsics.fx)
    every = np.concatenate(pixels)
    return float(np.percentile(every, NEAREST_PERCENTILE)) if every.size else 1.0


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
        if factor == 1:
            return self
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


def within(grids: Sequence[Grid], most: float | None) -> tuple[float, list[Grid]]:
    """Return the factor >= 1 on all edges that leaves at most so many voxels, and those voxels.

    Voxels of a surface: their number falls with the square of the edge.
    """
    factor, found = 1.0, finest_of(grids)
    for _ in range(MOST_STEPS):
        if most is None or count(found) <= most:
            break
        factor *= (count(found) / (CLOSE * most)) ** 0.5
        found = finest_of([grid.coarser(factor) for grid in grids])
    return factor, found


def wanted_points(config: InitConfig) -> int | None:
    """Return the most points that are wanted; None: as many as there are voxels of a given size."""
    return config.target_points or (MOST_POINTS if config.voxel_edge is None else None)


def factor_to_share(grids: Sequence[Grid], config: InitConfig) -> float:
    """Return the factor >= 1 on the edges that makes them a share of the object's longest side."""
    if config.voxel_unit != "object" or config.voxel_edge is None or config.target_points:
        return 1.0
    places = np.concatenate([grid.voxels.points_world for grid in grids])
    low, high = np.percentile(places, [BOX_PERCENTILE, 100 - BOX_PERCENTILE], axis=0)
    return max(1.0, config.voxel_edge * float((high - low).max()) / grids[0].edge)


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
