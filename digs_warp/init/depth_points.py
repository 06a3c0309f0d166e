"""All depth maps -> one point cloud P* (paper section 3.3.1, eq. 8 to 10)."""

import logging
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.config import MASK_THRESHOLD, InitConfig
from digs_warp.init.start import DepthReport
from digs_warp.init.view_points import FILTERS, ViewPoints, map_frames, view_points
from digs_warp.init.visibility import (
    THINNED,
    DepthViews,
    agreement_of_views,
    not_isolated,
    not_seen_through,
    onto_surface,
)
from digs_warp.init.voxel import GrowingGrid, VoxelSums, final_voxel_size, first_voxel_size
from digs_warp.record.run_log import timed
from digs_warp.words import counted

logger = logging.getLogger(__name__)

# What drops pixels between one of `digs_warp.init.view_points.FILTERS` and the next.
STAGES = ("missing depth", "the edge filter", "the foreground filter")


def filter_summary(report: DepthReport) -> str:
    """Return the counts after each stage, and the stage that dropped the largest share."""
    kept, stage = min(zip(report.kept.values(), STAGES, strict=False))
    pixels = ", ".join(f"{count:,} {name}" for name, count in report.pixels.items())
    return (
        f"pixels: {pixels}; voxels of {1e3 * report.voxel_size:.2g} mm, the resolution of the depth maps: "
        f"{report.voxels['occupied']:,} occupied; {stage} dropped most, {1 - kept:.0%}"
    )


# A view whose depth puts more than this share of its mask in the background: depth and mask disagree.
DISAGREEMENT = 0.25


# What to do when no pixel has depth.
CHECK_DEPTH = (
    "check the depth maps: metres in EXR, millimetres in 16-bit PNG, and the sensor's range"
)


class NoPointsError(DigsError):
    """No depth of any view passes the filters."""


def depth_points(
    frames: Sequence[Frame],
    config: InitConfig,
    sfm_per_metre: float | None = None,
) -> tuple[PointCloud, DepthReport]:
    """Return the points of all views, one per voxel (eq. 10), ordered by voxel, and the counts.

    Views without a foreground pixel are skipped with a warning. All cores read frames; memory holds only a
    few frames and the grid, however long the recording is. The result does not depend on the number of
    threads.

    Args:
        frames: with image, depth, mask and a metric camera.
        config: the settings.
        sfm_per_metre: for a voxel size in units of structure from motion.

    Raises:
        DigsError: no frames, or a frame without depth or mask.
        NoPointsError: not a single point in any view.
    """
    require_layers(frames, (Layer.DEPTH, Layer.MASK))
    report = DepthReport(pixels=dict.fromkeys(FILTERS, 0))
    size = first_voxel_size(frames, config, sfm_per_metre)
    grid = GrowingGrid()
    seen = []
    for view in map_frames(frames, partial(view_points, config=config, voxel_size=size)):
        _warn_of_odd_masks(view)
        with timed(report.seconds, "merge", time.thread_time):
            grid.add(view.voxels)
        report.add(view)
        if view.thinned_depth is not None:
            seen.append((view.camera, view.thinned_depth))
    with timed(report.seconds, "merge", time.thread_time):
        voxels = grid.merged()
    if len(voxels) == 0:
        raise _no_points_error(len(frames), report.pixels)
    report.voxels["occupied"] = len(voxels)
    if config.visibility_check:
        with timed(report.seconds, "visibility", time.process_time):
            views = DepthViews.of(seen)
            voxels = _thinned(_seen(voxels, views, size, report), views, size)
        report.voxels["on the surface"] = len(voxels)
    report.voxel_size = final_voxel_size(voxels, size, config)
    if report.voxel_size > size:
        voxels = voxels.coarser(report.voxel_size)
        report.voxels["coarser"] = len(voxels)
    if report.voxel_size == size and len(voxels) < (config.target_points or 0):
        logger.warning(
            "--target-points: %d wanted, %d found; %s",
            *(config.target_points, len(voxels), filter_summary(report)),
        )
    with timed(report.seconds, "strays", time.process_time):
        voxels = voxels.select(not_isolated(voxels.points_world, report.voxel_size))
    report.voxels["not alone"] = len(voxels)
    points = PointCloud(voxels.points_world, voxels.colors)
    if config.visibility_check:
        with timed(report.seconds, "visibility", time.process_time):
            agreement = agreement_of_views(voxels.points_world, views, report.voxel_size)
        points = replace(points, agreement=agreement)
    return points, report


def _seen(
    voxels: VoxelSums, views: DepthViews, voxel_size: float, report: DepthReport
) -> VoxelSums:
    """Return the voxels that no more views contradict than confirm; all where that leaves none."""
    visible = not_seen_through(voxels.points_world, views, voxel_size)
    voxels = voxels.select(visible) if visible.any() else voxels
    report.voxels["not seen through"] = len(voxels)
    return voxels


def _thinned(voxels: VoxelSums, views: DepthViews, voxel_size: float) -> VoxelSums:
    """Return a cloud about one voxel thick, where the views together measured the surface."""
    for _ in range(THINNED):
        voxels = voxels.moved(onto_surface(voxels.points_world, views, voxel_size), voxel_size)
    return voxels


def _warn_of_odd_masks(view: ViewPoints) -> None:
    in_mask, _, smooth, foreground = (view.pixels[name] for name in FILTERS)
    if in_mask == 0:
        logger.warning("frame '%s': no mask pixel above %d, skipped", view.name, MASK_THRESHOLD)
    elif foreground < (1 - DISAGREEMENT) * smooth:
        logger.warning(
            "frame '%s': its depth puts %.0f%% of its mask in the background; check the mask",
            view.name,
            100 * (1 - foreground / smooth),
        )


def require_layers(frames: Sequence[Frame], layers: Sequence[Layer]) -> None:
    """Raise a `DigsError` unless there are frames, all with ``layers``."""
    if not frames:
        raise DigsError("initialization: no frames; the capture needs at least one training frame")
    advice = {
        Layer.DEPTH: "depth maps (float EXR in metres or 16-bit PNG in millimetres)",
        Layer.MASK: "object masks (8-bit PNG; --masks makes some, --subject scene needs none)",
    }
    for layer in layers:
        lacking = [frame.name for frame in frames if not frame.has(layer)]
        if lacking:
            raise DigsError(
                f"initialization: {len(lacking)} of {len(frames)} frames have no '{layer.value}' "
                f"(the first is '{lacking[0]}'); add {advice[layer]} to the capture or leave these frames out"
            )


def _no_points_error(frames: int, pixels: dict[str, int]) -> NoPointsError:
    in_mask, with_depth, smooth, _ = (pixels[name] for name in FILTERS)
    if in_mask == 0:
        hint = f"check the masks: 255 marks the object, values up to {MASK_THRESHOLD} do not"
    elif with_depth == 0:
        hint = CHECK_DEPTH
    elif smooth == 0:
        hint = "the depth is too sparse for the edge filter, turn it off"
    else:
        hint = "the depth puts it all in the background: check the masks, or turn off the foreground filter"
    return NoPointsError(
        f"initialization: no points in {counted(frames, 'frame')}: {in_mask} pixels inside the "
        f"masks, {with_depth} of them with depth, {smooth} after the edge filter; {hint}"
    )
