"""All depth maps -> the points of a whole scene: a room, a street, everything that the camera saw.

Around an object, surfaces are at one distance, and what is not the object is left out. In a scene they are at
all distances, and a place without points shows the background color. So voxels grow with the distance
(`digs_warp.init.scene_view`), nothing is left out as background, and pixels without depth, such as windows,
shiny floors and what lies beyond the sensor's range, are placed at the depth of the nearest pixel that has
one. Such guesses are kept where no view measured a surface and no view sees through them, and start almost
transparent.
"""

import logging
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.config import InitConfig
from digs_warp.init.depth_points import CHECK_DEPTH, NoPointsError, require_layers
from digs_warp.init.scene_view import (
    SCENE_FILTERS,
    Grid,
    Levels,
    LevelSums,
    count,
    finest_of,
    scene_view,
)
from digs_warp.init.start import DepthReport
from digs_warp.init.view_points import map_frames
from digs_warp.init.visibility import DepthViews, agreement_of_views, not_isolated, not_seen_through
from digs_warp.init.voxel import MOST_POINTS
from digs_warp.record.run_log import timed
from digs_warp.words import counted

logger = logging.getLogger(__name__)

# The finest grid suits this percentile of the depths: what is nearer gets the same voxels.
NEAREST_PERCENTILE = 2.0

# Views that tell how near the surfaces are, and every n-th row and column of them.
LOOKED_AT, STRIDE = 16, 4

# The search for the edge lengths that give a number of points ends this close to it, or after some steps.
CLOSE, MOST_STEPS = 0.95, 4


def scene_points(frames: Sequence[Frame], config: InitConfig) -> tuple[PointCloud, DepthReport]:
    """Return the points of all views, one per voxel, from the finest grid to the coarsest, and the counts.

    Args:
        frames: with image, depth and a metric camera; masks are not used.
        config: the settings; those of masks and foreground are not used.

    Raises:
        DigsError: no frames, a frame without depth, or a voxel size as a fraction of an object.
        NoPointsError: not a single point in any view.
    """
    require_layers(frames, (Layer.DEPTH,))
    levels = _levels(frames, config)
    report = DepthReport(pixels=dict.fromkeys(SCENE_FILTERS, 0))
    measured, guessed, seen = LevelSums(), LevelSums(), []
    for view in map_frames(frames, partial(scene_view, config=config, levels=levels)):
        measured.add(view.measured)
        guessed.add(view.guessed)
        report.add(view)
        seen.append((view.camera, view.thinned_depth))
    if not measured.grids:
        raise _no_points_error(len(frames), report.pixels)
    with timed(report.seconds, "grids"):
        surfaces = measured.merged(levels)
        report.voxels["occupied"] = count(surfaces)
        factor, surfaces = _within_budget(surfaces, config)
        guesses = finest_of(
            [
                grid.coarser(factor).uncovered_by(
                    [s for s in surfaces if s.edge <= factor * grid.edge]
                )
                for grid in guessed.merged(levels)
            ]
        )
    if config.visibility_check:
        with timed(report.seconds, "visibility"):
            views = DepthViews.of(seen)
            surfaces, guesses = ([_visible(g, views) for g in some] for some in (surfaces, guesses))
    report.voxels["not seen through"] = count(surfaces)
    with timed(report.seconds, "strays"):
        surfaces = _in_company(surfaces)
    report.voxels["not alone"] = count(surfaces)
    report.voxels["guessed"] = count(guesses)
    report.voxel_size = factor * levels.finest
    made = [[g.points for g in some] for some in (surfaces, guesses)]
    guessed = [replace(cloud, guessed=np.ones(len(cloud), dtype=bool)) for cloud in made[1]]
    if config.visibility_check:
        with timed(report.seconds, "visibility"):
            made[0] = [_agreed(*each, views) for each in zip(made[0], surfaces, strict=True)]
    points = PointCloud.joined([*made[0], *guessed])
    return points, report


def _levels(frames: Sequence[Frame], config: InitConfig) -> Levels:
    if config.voxel_unit == "object":
        raise DigsError(
            "voxel_unit object: a whole scene has no object to measure; choose metre, or no voxel size"
        )
    if config.voxel_edge is not None:
        return Levels(config.voxel_edge, None)
    pixels = []
    for number in range(0, len(frames), max(1, len(frames) // LOOKED_AT)):
        depth = frames[number].load_depth()[::STRIDE, ::STRIDE]
        known = depth[~np.isnan(depth)]
        if known.size:
            pixels.append(known / frames[number].camera.intrinsics.fx)
    # Without any depth the views will raise the error.
    width = float(np.percentile(np.concatenate(pixels), NEAREST_PERCENTILE)) if pixels else 1.0
    return Levels(config.voxel_pixels * width, config.voxel_pixels)


def _within_budget(grids: Sequence[Grid], config: InitConfig) -> tuple[float, list[Grid]]:
    """Return the factor on all edges that leaves about the wanted number of voxels, and those voxels."""
    wanted = config.target_points
    if wanted is None and config.voxel_edge is None:
        wanted = MOST_POINTS

    def kept(factor: float) -> list[Grid]:
        some = [grid.coarser(factor) for grid in grids] if factor > 1 else grids
        return finest_of(some)

    factor, found = 1.0, kept(1.0)
    steps = 0
    # Voxels of a surface: their number falls with the square of the edge.
    while wanted is not None and count(found) > wanted and steps < MOST_STEPS:
        factor *= (count(found) / (CLOSE * wanted)) ** 0.5
        found = kept(factor)
        steps += 1
    if factor > 1:
        logger.info(
            "the depth maps resolve more points; voxels %.2g times as wide keep %s. --target-points "
            "chooses another number",
            *(factor, f"{count(found):,}"),
        )
    return factor, found


def _agreed(points: PointCloud, grid: Grid, views: DepthViews) -> PointCloud:
    """Return the points of a grid with the share of views that agree with each."""
    return replace(points, agreement=agreement_of_views(grid.voxels.points_world, views, grid.edge))


def _visible(grid: Grid, views: DepthViews) -> Grid:
    """Return the voxels that no more views see through than confirm."""
    return grid.select(not_seen_through(grid.voxels.points_world, views, grid.edge))


def _in_company(grids: Sequence[Grid]) -> list[Grid]:
    """Return the voxels that have others around them, on whatever grid."""
    every = np.concatenate([grid.voxels.points_world for grid in grids])
    keep = not_isolated(every, max(grid.edge for grid in grids))
    ends = np.cumsum([len(grid.voxels) for grid in grids])
    return [grid.select(some) for grid, some in zip(grids, np.split(keep, ends[:-1]), strict=True)]


def _no_points_error(frames: int, pixels: dict[str, int]) -> NoPointsError:
    hint = "the depth is too sparse for the edge filter, turn it off"
    if not pixels["with depth"]:
        hint = CHECK_DEPTH
    return NoPointsError(
        f"initialization: no points in {counted(frames, 'frame')}: {pixels['with depth']} pixels with depth, "
        f"{pixels['away from edges']} after the edge filter; {hint}"
    )
