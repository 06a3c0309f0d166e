"""Posed frames and points -> trained Gaussians (paper section 3.4): what is drawn, read, and started from."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from digs_warp.data.capture import Capture
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.init.first_exposures import first_exposures, without_exposure
from digs_warp.init.seeds import seed_gaussians, seed_start, with_colors
from digs_warp.init.seen_colors import look_up
from digs_warp.init.start import Start
from digs_warp.init.view_dependence import ViewDependence, view_dependence
from digs_warp.pipeline.config import ReconstructConfig
from digs_warp.pipeline.records import Poses, stored
from digs_warp.pipeline.refine_poses import with_trained_poses
from digs_warp.poses.in_training import PoseTraining
from digs_warp.poses.outcome import PoseRefinement
from digs_warp.record.layout import GAUSSIANS, RUN_RECORD, TRAINING
from digs_warp.record.manifest import is_kept
from digs_warp.record.run_log import RunLog, RunRecord
from digs_warp.record.typed import to_json
from digs_warp.train.config import TrainConfig
from digs_warp.train.evaluate import TestViews, load_test_views
from digs_warp.train.session import (
    Hooks,
    Trained,
    TrainingData,
    load_trained_poses,
    open_data,
    plan_training,
    train_gaussians,
)
from digs_warp.train.shutter import Shutter, plan_blur, plan_rows, with_motions
from digs_warp.train.trainer import Resolved
from digs_warp.train.training import Training, read_course


@dataclass(frozen=True, eq=False)
class Optimized:
    """What the training leaves to the evaluation.

    Attributes:
        poses: with the poses that the training found, if it trained them.
        trained: the Gaussians, their record, and how the held-out views look if that is known.
        test_views: held out, with these poses.
    """

    poses: Poses
    trained: Trained
    test_views: TestViews


def optimize(
    capture: Capture,
    poses: Poses,
    start: Start,
    config: ReconstructConfig,
    folder: Path,
    log: RunLog,
    before: RunRecord | None,
    hooks: Hooks,
) -> Optimized:
    """Train Gaussians from ``start``, or take over a finished training.

    Args:
        capture: the recording.
        poses: its frames as posed.
        start: the points to start from.
        config: of the reconstruction.
        folder: of the reconstruction.
        log: receives times.
        before: the record of the run that goes on in ``folder``; None: it starts.
        hooks: what the caller adds to the training.

    Raises:
        DigsError: bad views, a broken checkpoint, or a training that diverged.
    """
    poses, shutter = _with_shutter(capture, poses, start, config)
    trained = _finished(folder, before, len(poses.posed.by_time)) if before else None
    with log.stage("load views"):
        seeds = _seeds(poses, start, config) if trained is None else None
        resolved = Resolved(
            None, pose_training(poses.refinement), False, hooks.loss, config.train.stop.iterations
        )
        views = _load_views(
            *(poses.posed, start.points, seeds, shutter, config.train, folder),
            *(before is not None, resolved),
        )
    if trained is None:
        assert seeds is not None
        plan = stored(Training, before, folder).plan
        if config.train.stop.time_budget is not None and plan is None:
            with log.stage("plan"):
                plan = plan_training(*_colored(seeds, views, config.train), config.train)
            log.results["training"] = to_json(Training(plan=plan))
            log.save(folder / RUN_RECORD)
        if plan is not None:
            stop = replace(config.train.stop, iterations=plan.iterations)
            config = replace(config, train=replace(config.train, stop=stop))
            seeds = _seeds(poses, start, config)
        train = config.train
        if views.color is not None:
            train = replace(train, sh_degree=views.color.degree)
        colored, data = _colored(seeds, views, train)
        trained = train_gaussians(
            *(colored, data, views.held_out, train, folder, log), watch=hooks.watch, plan=plan
        )
    record = replace(
        trained.record,
        rolling_shutter=shutter.rows,
        motion_blur=shutter.blur,
        view_dependence=views.color,
    )
    frames, test_views = with_trained_poses(poses.posed, views.held_out, trained.poses, folder)
    trained = replace(trained, record=record)
    return Optimized(replace(poses, frames=frames), trained, test_views)


def _with_shutter(
    capture: Capture, poses: Poses, start: Start, config: ReconstructConfig
) -> tuple[Poses, Shutter]:
    """Return the frames with what is known of their motion, and whether the training draws it."""
    readout_time = config.sfm.for_capture(capture).readout
    frames, training = poses.posed, len(poses.posed.training)
    every = with_motions([*frames.training, *frames.held_out])
    points, train = start.points.points_world, config.train
    shutter = Shutter(
        plan_rows(every, points, readout_time, train.rolling_shutter),
        plan_blur(every, points, train.exposure_time, train.motion_blur),
    )
    moving = replace(frames, training=tuple(every[:training]), held_out=tuple(every[training:]))
    return replace(poses, frames=moving), shutter


def _finished(folder: Path, before: RunRecord, frames: int) -> Trained | None:
    """Return the finished training of an earlier run, if there is one."""
    if not is_kept(folder / GAUSSIANS):
        return None
    record = stored(Training, before, folder, course=read_course(folder / TRAINING))
    poses = load_trained_poses(folder, frames)
    return Trained(Gaussians.load(folder / GAUSSIANS), record, poses)


def _seeds(poses: Poses, start: Start, config: ReconstructConfig) -> Gaussians:
    """Return the Gaussians to start from, in the colors of the first points."""
    init = replace(config.init, strategy=start.strategy or config.init.strategy)
    looks = seed_start(init, poses.subject, config.train.stop.iterations)
    return seed_gaussians(start.points, config.train.usual_sh_degree, *looks)


@dataclass(frozen=True, eq=False)
class _LoadedViews:
    """What is read of the frames."""

    data: TrainingData | None  # None without a training
    held_out: TestViews
    color: ViewDependence | None  # None where the settings say its degree
    points: PointCloud  # in the colors of photographs of one exposure if that is fitted


def _load_views(
    posed: PosedFrames,
    points: PointCloud,
    seeds: Gaussians | None,
    shutter: Shutter,
    config: TrainConfig,
    folder: Path,
    resume: bool,
    resolved: Resolved,
) -> _LoadedViews:
    """Read the views, and beside that do what takes one core; without ``seeds`` there is no training."""
    frames = posed.training
    with ThreadPoolExecutor(2) as beside:
        opening = None
        if seeds is not None:
            opening = beside.submit(open_data, frames, config, folder, resume, shutter)
        held_out = load_test_views(posed.held_out, shutter)
        judging, constant = None, False
        evens = seeds is not None and config.fit_exposure == "on"
        if evens or config.sh_degree is None:
            seen = look_up(frames, points.points_world)
            if config.sh_degree is None:
                judging = beside.submit(view_dependence, seen)
            found = first_exposures(points, frames, seen) if evens else None
            if found is not None:
                points, constant = without_exposure(points, frames, found), not found.vary
        resolved = replace(resolved, held=points.hidden, constant_exposure=constant)
        data = replace(opening.result(), resolved=resolved) if opening else None
        return _LoadedViews(data, held_out, judging.result() if judging else None, points)


def _colored(
    seeds: Gaussians, views: _LoadedViews, config: TrainConfig
) -> tuple[Gaussians, TrainingData]:
    """Return the Gaussians in the colors of the first points, and the data to train them on."""
    assert views.data is not None
    return with_colors(seeds, views.points.colors, config.usual_sh_degree), views.data


def pose_training(refinement: PoseRefinement | None) -> PoseTraining:
    """Return what the cameras do in the training: centers that a bundle adjustment found are held."""
    if refinement is None or not refinement.in_training:
        return "held"
    return "turned" if refinement.adjusted else "moved"
