"""Voxel-grid filter: one point per occupied voxel, at the mean of its measurements (paper eq. 10).

Every view sees the same surface again; the grid merges many noisy measurements of a spot into one point.
The grid is anchored at the world's origin, so the sums of separate batches can be merged: a recording is
reduced view by view and never held in memory as a whole.

By default a voxel is as large as two pixels at the object's distance: what the images resolve, for a cup and
for a car. The paper states its voxel sizes, 0.04 and 0.1, in the arbitrary unit of its structure from motion.
A size in metres or in units of structure from motion is known at the start. A fraction of the object or a
number of points is not: then the grid starts as fine as the depth maps resolve, and is coarsened after all
views were added.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.checks import DigsError, check_positive
from digs_warp.data.frame import Frame
from digs_warp.init.config import InitConfig
from digs_warp.init.strategies import FINE_PIXELS

logger = logging.getLogger(__name__)

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


# Views that tell how large a pixel is at the object.
LOOKED_AT = 8

# More points than this are never wanted by default: a step of the training takes too long on a CPU.
MOST_POINTS = 200_000

# The object's box ignores this percentage of the voxels at either end of each axis.
BOX_PERCENTILE = 0.5

# Bisection steps in the search for the voxel size that gives a number of points.
SEARCH_STEPS = 16


def first_voxel_size(
    frames: Sequence[Frame], config: InitConfig, sfm_per_metre: float | None
) -> float:
    """Return the edge length [m] of the grid on which the views are summed.

    Raises:
        DigsError: a size in units of structure from motion, but no scale.
    """
    if config.target_points is not None or config.voxel_unit == "object":
        return FINE_PIXELS * pixel_size(frames, config.mask_level)
    if config.voxel_edge is None:
        return config.voxel_pixels * pixel_size(frames, config.mask_level)
    if config.voxel_unit == "metre":
        return config.voxel_edge
    if sfm_per_metre is None:
        raise DigsError(
            "voxel_unit sfm: needs structure from motion (--poses sfm); with the recorded poses choose "
            "metre or object"
        )
    return config.voxel_edge / sfm_per_metre


def final_voxel_size(voxels: VoxelSums, size: float, config: InitConfig) -> float:
    """Return the requested edge length [m], at least ``size``, that of the current grid.

    For more ``target_points`` than there are voxels it is ``size``; the caller says what became of them.
    """
    if config.target_points is not None:
        return _size_for_count(voxels, size, config.target_points)
    if config.voxel_edge is None:
        return _size_for_most(voxels, size)
    if config.voxel_unit != "object":
        return size
    wanted = config.voxel_edge * object_size(voxels)
    if wanted < size:
        logger.warning(
            "--voxel-size: %g of the object is finer than its depth maps resolve; using %.2g m",
            config.voxel_edge,
            size,
        )
    return max(wanted, size)


def object_size(voxels: VoxelSums) -> float:
    """Return the longest side [m] of the box around the voxels, without the outermost few."""
    low, high = np.percentile(voxels.points_world, [BOX_PERCENTILE, 100 - BOX_PERCENTILE], axis=0)
    return float((high - low).max())


def pixel_size(frames: Sequence[Frame], mask_level: int) -> float:
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


def _size_for_most(voxels: VoxelSums, size: float) -> float:
    """Return ``size``, or the size that keeps the points below `MOST_POINTS`."""
    if len(voxels) <= MOST_POINTS:
        return size
    coarser = _size_for_count(voxels, size, MOST_POINTS)
    logger.info(
        "the depth maps resolve %s points; voxels of %.2g mm instead of %.2g mm keep %s. --voxel-size "
        "chooses other ones",
        *(f"{len(voxels):,}", 1e3 * coarser, 1e3 * size, f"{MOST_POINTS:,}"),
    )
    return coarser


def _size_for_count(voxels: VoxelSums, size: float, wanted: int) -> float:
    points = voxels.points_world

    def count(edge: float) -> int:
        keys = np.sort(voxel_keys(points, edge))  # `np.unique` hashes, five times as slowly
        return 1 + int(np.count_nonzero(np.diff(keys)))

    if count(size) <= wanted:
        return size
    fine, coarse = size, max(2 * size, object_size(voxels))
    largest = 2 * float(np.abs(voxels.points_world).max())
    while count(coarse) > wanted:
        if coarse > largest:  # one voxel in each octant around the origin: no grid has fewer
            logger.warning(
                "--target-points: %d wanted, but the coarsest grid has %d", wanted, count(coarse)
            )
            return coarse
        coarse *= 2
    for _ in range(SEARCH_STEPS):
        middle = float(np.sqrt(fine * coarse))
        fine, coarse = (middle, coarse) if count(middle) > wanted else (fine, middle)
    return coarse
