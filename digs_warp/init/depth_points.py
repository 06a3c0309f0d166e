"""All depth maps -> one point cloud P* (paper section 3.3.1, eq. 8 to 10), of an object or of a whole scene.

In a scene nothing is left out as background, voxels grow with the distance (`digs_warp.init.levels`), and
pixels without depth are guessed. Guesses are kept where no view measured a surface and no view sees through
them, and start almost transparent.
"""

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.viewpoints import evenly
from digs_warp.init.config import FINE_PIXELS, MASK_THRESHOLD, InitConfig
from digs_warp.init.levels import (
    Levels,
    LevelSums,
    chosen_levels,
    count,
    finest_of,
    wanted_points,
    within,
)
from digs_warp.init.start import DepthReport, Subject
from digs_warp.init.view_points import IN_VIEW, ViewPoints, map_frames, view_points
from digs_warp.init.visibility import (
    DepthViews,
    agreement_of_views,
    not_seen_through,
    onto_surface,
)
from digs_warp.init.voxel import Voxels
from digs_warp.words import counted

logger = logging.getLogger(__name__)

# A cloud is thinned this many times: views are compared anew where its points lie by then. Mustard bottle,
# vase and spot, 500 steps: 102,000 points and 30.95 dB before; 51,000 and 30.82 dB after two, 42,000 and
# 30.75 dB after four times. A coarser grid of 38,000 points: 30.4 dB.
THINNED = 4
# It is thinned from at most so many times as many points as are wanted: it leaves a half to a third of them.
SPARE = 3.0
# Guessed points of a scene, in terms of those that are wanted: hardly matched photographs have many.
GUESSED_SHARE = 0.5
# Points are compared with at most this many views, evenly spread: each place is in many of them.
COMPARED = 60
# If so many large views fill as many voxels already, all are put on coarser grids at once.
FEW_VIEWS = 8


class NoPointsError(DigsError):
    """No depth of any view passes the filters."""


def depth_points(
    frames: Sequence[Frame],
    config: InitConfig,
    subject: Subject = "object",
) -> tuple[PointCloud, DepthReport]:
    """Return the points of all views, one per voxel (eq. 10), ordered by grid and voxel, and the counts.

    Views without a foreground pixel are skipped with a warning. All cores read frames; memory holds only a
    few frames and the grids, however long the recording is. The result does not depend on the number of
    threads.

    Args:
        frames: with image, depth and a metric camera; of an object with mask.
        config: the settings.
        subject: what is reconstructed.

    Raises:
        DigsError: no frames, or a frame without depth or mask.
        NoPointsError: not a single point in any view.
    """
    is_object = subject == "object"
    require_layers(frames, (Layer.DEPTH, Layer.MASK) if is_object else (Layer.DEPTH,))
    report = DepthReport()
    wanted = wanted_points(config)
    at_first = wanted and (SPARE if is_object else 1.0) * wanted
    resolved = chosen_levels(frames, config, subject)
    work = partial(view_points, config=config, subject=subject)
    levels = _coarser_at_once(frames, resolved, work, at_first)
    measured, guessed, seen, beside = LevelSums(), LevelSums(), [], []
    for view in map_frames(frames, partial(work, levels=levels)):
        if is_object and not any(view.pixels.values()):
            logger.warning("frame '%s': no mask pixel above %d, skipped", view.name, MASK_THRESHOLD)
        measured.add(view.measured)
        guessed.add(view.guessed)
        report.add(view)
        seen.append((view.camera, view.thinned_depth))
        beside.append(view.beside)
    views = DepthViews.of(evenly(seen, COMPARED), evenly(beside, COMPARED))
    factor, surfaces = within(measured.grids, at_first)
    if not surfaces:
        raise _no_points_error(len(frames), report.pixels)
    report.voxels["occupied"] = count(surfaces)
    guesses = _guesses(guessed.grids, surfaces, factor)
    surfaces, guesses = (_visible(some, views) for some in (surfaces, guesses))
    report.voxels["not seen through"] = count(surfaces)
    if is_object:
        surfaces = [_thinned(grid, views) for grid in surfaces]
        report.voxels["on the surface"] = count(surfaces)
        more, surfaces = within(surfaces, wanted)
        factor *= more
    report.voxel_size = factor * levels.finest
    if report.voxel_size > resolved.finest and config.target_points is None:
        logger.info(
            "the depth maps resolve more points; voxels %.2g times as wide keep %s. --voxel-size or "
            "--target-points choose others",
            *(report.voxel_size / resolved.finest, f"{count(surfaces):,}"),
        )
    points = [_agreed(grid, views) for grid in surfaces]
    if not is_object:
        _, guesses = within(guesses, at_first and GUESSED_SHARE * at_first)
        report.voxels["guessed"] = count(guesses)
        points += [replace(g.points, guessed=np.ones(len(g), bool)) for g in guesses]
    return PointCloud.joined(points), report


def _coarser_at_once(
    frames: Sequence[Frame],
    levels: Levels,
    work: Callable[..., ViewPoints],
    most: float | None,
) -> Levels:
    """Return grids on which a few of the views fill no more voxels: all of them fill at least as many."""
    some = evenly(frames, FEW_VIEWS)
    k = frames[0].camera.intrinsics
    if most is None or len(some) * k.width * k.height <= most * FINE_PIXELS**2:
        return levels
    sums = LevelSums()
    for view in map_frames(some, partial(work, levels=levels)):
        sums.add(view.measured)
    grids, stride = sums.grids, 1
    # An object starts from SPARE times as many voxels as are wanted, so fewer pixels do for them.
    if levels.pixels is None:
        stride = round(within(grids, most / SPARE)[0])
    return replace(levels, finest=within(grids, most)[0] * levels.finest, stride=stride)


def _guesses(grids: Sequence[Voxels], surfaces: Sequence[Voxels], factor: float) -> list[Voxels]:
    """Return the guesses, on grids as much coarser as the surfaces, where there are no surfaces as fine."""
    coarser = [grid.coarser(factor) for grid in grids]
    open_ = [g.uncovered_by([s for s in surfaces if s.edge <= g.edge]) for g in coarser]
    return finest_of(open_)


def _visible(grids: Sequence[Voxels], views: DepthViews) -> list[Voxels]:
    """Return the voxels that no more views see through than confirm; all where that leaves none."""
    kept = [g.select(not_seen_through(g.points_world, views, g.edge)) for g in grids]
    return kept if count(kept) else list(grids)


def _thinned(voxels: Voxels, views: DepthViews) -> Voxels:
    """Return a cloud about one voxel thick, where the views together measured the surface."""
    for _ in range(THINNED):
        voxels = voxels.moved(onto_surface(voxels.points_world, views, voxels.edge))
    return voxels


def _agreed(grid: Voxels, views: DepthViews) -> PointCloud:
    """Return the points of a grid with the share of views that agree with each."""
    agreement = agreement_of_views(grid.points_world, views, grid.edge)
    return replace(grid.points, agreement=agreement)


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
    where = "inside the masks" if IN_VIEW not in pixels else IN_VIEW
    looked_at, with_depth, smooth, *_ = pixels.values()
    hint = "the depth puts it all in the background: check the masks"
    if looked_at == 0:
        hint = f"check the masks: 255 marks the object, values up to {MASK_THRESHOLD} do not"
    elif with_depth == 0:
        hint = (
            "check the depth maps: metres in EXR, millimetres in 16-bit PNG; and the sensor's range"
        )
    return NoPointsError(
        f"initialization: no points in {counted(frames, 'frame')}: {looked_at} pixels {where}, {with_depth} "
        f"of them with depth, {smooth} after the edge filter; {hint}"
    )
