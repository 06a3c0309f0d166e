"""The five initializations (paper sections 3.3 and 4.1): frames and sparse points -> colored points.

Everything is metric. With poses from structure from motion, the model was scaled once by the factor that
`digs_warp.init.scale` finds (eq. 6 and 7), so the paper's sigma* in eq. 8 is 1 here.
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.sfm_model import SfmModel
from digs_warp.init.config import MASK_THRESHOLD, InitConfig, StrategyName
from digs_warp.init.depth_points import NoPointsError, depth_points
from digs_warp.init.hull import hull_points
from digs_warp.init.multi_view_stereo import matched_depth
from digs_warp.init.scale import observed_pixels
from digs_warp.init.sparse_points import random_points
from digs_warp.init.start import DepthReport, Start, Subject
from digs_warp.init.unseen import fills_unseen, shell_points, unseen_points
from digs_warp.words import counted

logger = logging.getLogger(__name__)

# Photographs whose matching tells the depth of fewer pixels [share] are started from something else.
LEAST_MATCHED: Mapping[Subject, float] = {"object": 0.15, "scene": 0.01}
# Random points where neither photographs nor depth give a start; they also tell where cameras look.
RANDOM_POINTS = 20_000
# A stage that keeps a smaller share of pixels or voxels is said, for something is wrong there.
LEAST_KEPT = 0.2
# If a stage keeps less, fewer points than both of these are an error: small images have few as well.
FEWEST_POINTS, LEAST_PER_PIXEL = 1000, 1e-3
# The name of what the edge filter keeps in a `DepthReport`.
EDGES = "away from edges"


def initialize(
    frames: Sequence[Frame],
    config: InitConfig,
    sfm: SfmModel | None = None,
    subject: Subject = "object",
    recorded: PointCloud | None = None,
) -> Start:
    """Return the points of the configured strategy.

    Args:
        frames: training frames with metric cameras; held-out ones must not be among them.
        config: strategy and settings.
        sfm: structure from motion in metres (`SfmModel.in_metres`); None: the poses are the capture's.
        subject: what the points from depth cover; a scene needs no masks, and gets a far shell.
        recorded: the recording's own sparse points, which spare 'default' and 'random' those of ``sfm``.

    Raises:
        DigsError: something that the strategy needs is missing, or there are no points.
    """
    if config.strategy == "mvs":
        start = _from_photographs(frames, config, sfm, recorded, subject)
        config = replace(config, strategy=start.strategy or "mvs")
    elif config.strategy in ("default", "random", "hull"):
        start = _without_depth(frames, config, sfm, recorded)
    else:
        start = _from_depth(_with_depth(frames), config, sfm, subject)
    has_depth = any(frame.has(Layer.DEPTH) for frame in frames)
    start = replace(start, because=_reason(config.strategy, start.sources, has_depth))
    if subject == "object":
        return start
    shell = shell_points(start.points, [frame.camera for frame in frames])
    points = PointCloud.joined([start.points, shell])
    return replace(start, points=points, sources={**start.sources, "shell": len(shell)})


def _from_photographs(
    frames: Sequence[Frame],
    config: InitConfig,
    sfm: SfmModel | None,
    recorded: PointCloud | None,
    subject: Subject,
) -> Start:
    """Return points from matched photographs; without texture, those of the hull, sparse or random ones."""
    known = recorded or (sfm.points if sfm else None)
    otherwise: StrategyName = "hull" if subject == "object" else "default" if known else "random"
    other = replace(config, strategy=otherwise)
    if otherwise == "random":
        count = config.target_points or RANDOM_POINTS
        other = replace(other, target_points=count, voxel_size=None)
    known = known or _without_depth(frames, other, None, None).points
    level = MASK_THRESHOLD if subject == "object" else -1
    matched, share = matched_depth(frames, known.points_world, level)
    said = f"matching the photographs tells the depth of {share:.0%} of their pixels"
    if share >= LEAST_MATCHED[subject]:
        logger.info(said)
        # The views have been compared already, and the gaps would count as edges.
        return _from_depth(matched, replace(config, edge_filter=False), sfm, subject)
    logger.warning(
        "%s, too little to start from: they show little texture, or their poses are wrong; starting from %s",
        *(said, _reason(otherwise, {}, has_depth=True)),
    )
    return replace(_without_depth(frames, other, sfm, recorded), strategy=otherwise)


def _with_depth(frames: Sequence[Frame]) -> Sequence[Frame]:
    """Return the frames that have depth, or all where none has any; single ones may lack it."""
    measured = [frame for frame in frames if frame.has(Layer.DEPTH)]
    if not measured or len(measured) == len(frames):
        return frames
    first = next(frame.name for frame in frames if not frame.has(Layer.DEPTH))
    logger.warning(
        "%s of %d without depth, first '%s': no points from there, only photographs to train on",
        *(counted(len(frames) - len(measured), "frame"), len(frames), first),
    )
    return measured


def _without_depth(
    frames: Sequence[Frame], config: InitConfig, sfm: SfmModel | None, recorded: PointCloud | None
) -> Start:
    if config.strategy == "hull":
        points = hull_points(frames, config)
        return Start(points, {"hull": len(points)})
    if config.strategy == "random":
        count = config.target_points or len(recorded or _needed(sfm, config).points)
        return Start(random_points([f.camera for f in frames], count), {"random": count})
    points = recorded or _needed(sfm, config).points
    return Start(points, {"recorded" if recorded else "sfm": len(points)})


def _from_depth(
    frames: Sequence[Frame],
    config: InitConfig,
    sfm: SfmModel | None,
    subject: Subject,
) -> Start:
    from_depth, report = _measured_points(frames, config, subject)
    points, sources = from_depth, {"depth": len(from_depth)}
    if config.strategy == "fusion":  # P_fusion = P_BB united with P*
        from_sfm = _unmasked_points_in_box(_needed(sfm, config), frames, from_depth.bounds)
        points, sources["sfm"] = PointCloud.joined([points, from_sfm]), len(from_sfm)
    if subject == "object" and fills_unseen(frames):
        unseen = unseen_points(frames, from_depth, report.voxel_size, config)
        if len(unseen):
            points, sources["unseen"] = PointCloud.joined([points, unseen]), len(unseen)
    return Start(points, sources, report)


def _measured_points(
    frames: Sequence[Frame], config: InitConfig, subject: Subject
) -> tuple[PointCloud, DepthReport]:
    """Return the points of the depth maps, without the edge filter where that drops nearly all of them."""
    try:
        points, report = depth_points(frames, config, subject)
        is_dotted = config.edge_filter and report.kept.get(EDGES, 1.0) < LEAST_KEPT
    except NoPointsError:
        if not config.edge_filter:
            raise
        is_dotted = True
    if is_dotted:
        config = replace(config, edge_filter=False)
        points, report = depth_points(frames, config, subject)
        logger.warning(
            "initialization: the edge filter would drop over %.0f %% of the depth, which consists of dots "
            "or thin lines: it is left out",
            100 * (1 - LEAST_KEPT),
        )
    for stage, kept in report.kept.items():
        if kept < LEAST_KEPT:
            logger.warning("initialization: only %.2g %% are %s (%s)", 100 * kept, stage, report)
    wanted, is_emptied = next(iter(report.pixels.values())), min(report.kept.values()) < LEAST_KEPT
    if is_emptied and len(points) < min(FEWEST_POINTS, LEAST_PER_PIXEL * wanted):
        raise DigsError(
            f"initialization: {len(points)} points are left of {wanted:,} pixels ({report}), which makes no "
            "scene. If the depth is that poor, start without it: --strategy mvs; else see what "
            "'digs-warp check' says of the recording"
        )
    return points, report


def _unmasked_points_in_box(
    sfm: SfmModel, frames: Sequence[Frame], box: tuple[np.ndarray, np.ndarray]
) -> PointCloud:
    """Return P_BB (section 3.3.2): the sparse points that no mask rejects, in the box of the depth points.

    A point must lie in the mask of every frame that saw it; a point that none of them saw is left out. A
    frame without a mask rejects nothing.

    Args:
        sfm: the model, in the unit of ``box``.
        frames: training frames with masks.
        box: corners (minimum, maximum), shape (3,) each.
    """
    seen = np.zeros(len(sfm.points), dtype=bool)
    rejected = np.zeros(len(sfm.points), dtype=bool)
    for frame in frames:
        if frame.name not in sfm.names:
            continue
        k = frame.camera.intrinsics
        points, rows, columns = observed_pixels(sfm, frame.name, (k.height, k.width))
        seen[points] = True
        if frame.has(Layer.MASK):
            rejected[points[frame.load_mask()[rows, columns] <= MASK_THRESHOLD]] = True
    positions = sfm.points.points_world
    in_box = np.all((positions >= box[0]) & (positions <= box[1]), axis=1)
    keep = seen & ~rejected & in_box
    return PointCloud(positions[keep], sfm.points.colors[keep])


def _reason(strategy: StrategyName, sources: dict[str, int], has_depth: bool) -> str:
    """Return a phrase such as "the sparse points of the recording, which has no depth".

    Args:
        strategy: how the points were made.
        sources: number of points by where they came from, as in `Start`.
        has_depth: whether a frame has a depth map.
    """
    lacks = "" if has_depth else "; the recording has no depth"
    if strategy == "mvs":
        return "depth that matching the photographs tells"
    if strategy in ("hull", "random"):
        return ("the visual hull of the masks" if strategy == "hull" else "random points") + lacks
    if strategy == "default" and "recorded" in sources:
        return "the sparse points of the recording" + ("" if has_depth else ", which has no depth")
    if strategy == "default":
        return "sparse points matched in the images" + lacks
    sparse = ", and sparse points matched in the images" if strategy == "fusion" else ""
    closed = "; closed where no view saw the object" if "unseen" in sources else ""
    return "points from the depth maps" + sparse + closed


def _needed(sfm: SfmModel | None, config: InitConfig) -> SfmModel:
    if sfm is None:
        raise DigsError(
            f"initialization '{config.strategy}': needs the sparse points of structure from motion; "
            "run with --poses sfm, or choose 'highdepth' or 'depth', which need depth maps only"
        )
    return sfm
