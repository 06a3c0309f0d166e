"""Depth-based initialization: all views -> one coloured point cloud (paper section 3.3.1).

The poses are the capture's own and metric, so the paper's scale factor between depth and poses is 1.
"""

import logging
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from digs_warp.capture import Frame
from digs_warp.checks import DigsError
from digs_warp.init.back_project import back_project
from digs_warp.init.config import InitConfig as InitConfig
from digs_warp.init.edges import smooth_depth
from digs_warp.init.voxel import VoxelSums, merge_voxel_sums, voxel_sums
from digs_warp.log import progress
from digs_warp.parallel import default_threads
from digs_warp.point_cloud import PointCloud

logger = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class _View:
    """One view reduced to the grid, and how many pixels were left after each filter."""

    name: str
    voxels: VoxelSums
    in_mask: int
    with_depth: int
    kept: int


def initial_points(frames: Sequence[Frame], config: InitConfig) -> PointCloud:
    """Return the points of all views, one per voxel (eq. 10), ordered by voxel.

    Views without a foreground pixel are skipped with a warning. Frames are read by all cores; memory
    holds a few frames and the grid, however long the recording is.

    Raises:
        DigsError: no frames, a frame without depth or mask, or not a single point in any view.
    """
    _require_depth_and_masks(frames)
    grid = _GrowingGrid()
    views: list[_View] = []
    with (
        ThreadPoolExecutor(default_threads()) as pool,
        progress(len(frames), "Back-projecting", "frame") as bar,
    ):
        for view in pool.map(partial(_reduce_view, config=config), frames):
            if view.in_mask == 0:
                logger.warning(
                    "frame '%s': no mask pixel above %d, skipped", view.name, config.mask_threshold
                )
            grid.add(view.voxels)
            views.append(view)
            bar.update()
    merged = grid.merged()
    if len(merged) == 0:
        raise _no_points_error(views, config)
    return merged.well_supported(config.min_support).mean_points()


def _reduce_view(frame: Frame, config: InitConfig) -> _View:
    """Apply the conditions of eq. 9 to one view, back-project what is left (eq. 8) and grid it."""
    depth = frame.load_depth()
    in_mask = frame.load_mask() > config.mask_threshold
    with_depth = in_mask & ~np.isnan(depth)
    keep = with_depth & smooth_depth(depth) if config.edge_filter else with_depth
    points_world, colors = back_project(frame.camera, frame.load_image(), depth, keep)
    return _View(
        name=frame.name,
        voxels=voxel_sums(points_world, colors, config.voxel_size),
        in_mask=int(np.count_nonzero(in_mask)),
        with_depth=int(np.count_nonzero(with_depth)),
        kept=int(np.count_nonzero(keep)),
    )


class _GrowingGrid:
    """Voxel sums of many views.

    New views wait until together they are as large as the grid, then merge: each voxel is sorted a
    logarithmic number of times, and memory stays within twice the grid.
    """

    def __init__(self) -> None:
        self._batches: list[VoxelSums] = []

    def add(self, voxels: VoxelSums) -> None:
        self._batches.append(voxels)
        if sum(map(len, self._batches[1:])) > len(self._batches[0]):
            self._batches = [self.merged()]

    def merged(self) -> VoxelSums:
        return merge_voxel_sums(self._batches)


def _require_depth_and_masks(frames: Sequence[Frame]) -> None:
    if not frames:
        raise DigsError("initialization: no frames; the capture needs at least one training frame")
    advice = {
        "depth_file_path": "depth maps (float EXR in metres or 16-bit PNG in millimetres)",
        "mask_path": "object masks (8-bit PNG, 255 on the object)",
    }
    for key, what in advice.items():
        lacking = [frame.name for frame in frames if not frame.has(key)]
        if lacking:
            raise DigsError(
                f"initialization: {len(lacking)} of {len(frames)} frames have no '{key}' "
                f"(the first is '{lacking[0]}'); add {what} to the capture or leave these frames out"
            )


def _no_points_error(views: Sequence[_View], config: InitConfig) -> DigsError:
    in_mask = sum(view.in_mask for view in views)
    with_depth = sum(view.with_depth for view in views)
    if in_mask == 0:
        hint = f"check the masks: 255 marks the object, values up to {config.mask_threshold} do not"
    elif with_depth == 0:
        hint = (
            "check the depth maps: metres in EXR, millimetres in 16-bit PNG, and the sensor's range"
        )
    else:
        hint = "the depth is too sparse for the edge filter, turn it off"
    return DigsError(
        f"initialization: no points in {len(views)} frames: {in_mask} pixels inside the masks, "
        f"{with_depth} of them with depth, 0 after the edge filter; {hint}"
    )
