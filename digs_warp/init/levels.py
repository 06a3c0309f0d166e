"""Grids of voxels whose edge lengths double: which one suits which distance, and how many voxels there are.

On and around an object, surfaces are at one distance: one grid suits all of them. In a scene they are at all
distances, and voxels grow with the distance. By default a voxel is as large as two pixels there: what the
images resolve, for a cup and for a car.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.init.config import FINE_PIXELS, MASK_THRESHOLD, InitConfig
from digs_warp.init.start import Subject
from digs_warp.init.voxel import Voxels, merged

# No more grids than this: the coarsest has voxels 2048 times as large as the finest.
MOST_LEVELS = 12

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

# New views are collected until together they have this many times the grid's voxels, then merged.
MERGE_AT = 3.0


@dataclass(frozen=True)
class Levels:
    """Which grid suits which distance.

    Attributes:
        finest: edge length of the finest grid [m].
        pixels: width of a voxel in pixels at its distance; None: the finest grid everywhere.
        stride: every n-th row and column of the views is used, as many as the voxels resolve.
    """

    finest: float
    pixels: float | None
    stride: int = 1

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


def chosen_levels(frames: Sequence[Frame], config: InitConfig, subject: Subject) -> Levels:
    """Return the grids on which the views are summed."""
    if config.voxel_size is not None:
        return Levels(config.voxel_size, None)
    # Of a wanted number of points, grids are coarsened after all views were added.
    pixels = FINE_PIXELS if config.target_points else config.defaults.voxel_pixels
    if subject == "object":
        return Levels(pixels * _pixel_at_object(frames), None)
    return Levels(pixels * _near_pixel(frames), pixels)


def _pixel_at_object(frames: Sequence[Frame]) -> float:
    """Return the width [m] of a pixel at the object: the median over a few views that show it."""
    sizes = []
    for number in range(0, len(frames), max(1, len(frames) // LOOKED_AT)):
        frame = frames[number]
        depth = frame.load_depth()[frame.load_mask() > MASK_THRESHOLD]
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


def finest_of(grids: Sequence[Voxels]) -> list[Voxels]:
    """Return the grids, from the finest to the coarsest, without voxels that finer ones cover."""
    kept: list[Voxels] = []
    for grid in grids:
        kept.append(grid.uncovered_by(kept))
    return kept


def count(grids: Iterable[Voxels]) -> int:
    """Return the number of voxels on all grids."""
    return sum(map(len, grids))


def within(grids: Sequence[Voxels], most: float | None) -> tuple[float, list[Voxels]]:
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
    return config.target_points or (MOST_POINTS if config.voxel_size is None else None)


class LevelSums:
    """Sums of many views on each grid.

    New views are collected until together they outweigh the grid, then merged. So each voxel is sorted a
    logarithmic number of times, and memory stays within a few times the grid.
    """

    def __init__(self) -> None:
        self._batches: dict[int, list[Voxels]] = defaultdict(list)

    def add(self, voxels: dict[int, Voxels]) -> None:
        """Add the voxels of one view, by the number of their grid."""
        for level, each in voxels.items():
            batches = self._batches[level]
            batches.append(each)
            if sum(map(len, batches[1:])) > MERGE_AT * len(batches[0]):
                batches[:] = [merged(batches)]

    @property
    def grids(self) -> list[Voxels]:
        """The sums of all views, from the finest grid to the coarsest."""
        return [merged(batches) for _, batches in sorted(self._batches.items())]
