"""Capture -> Gaussians: poses, initialization, training and evaluation, each stage cached and resumable.

docs/reconstruction-format.md describes the folder that `reconstruct` writes.
"""

import logging
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.decoded import decoded_once
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.posed_frames import CAMERAS
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.device.libraries import import_open3d, import_pycolmap
from digs_warp.device.threads import default_threads
from digs_warp.device.warp_start import require_device
from digs_warp.init.seed_gaussians import seed_gaussians, with_colors
from digs_warp.init.seed_start import seed_start
from digs_warp.measure.scores import Scores
from digs_warp.pipeline.frame_masks import MASKS
from digs_warp.pipeline.front_end import SFM, front_end
from digs_warp.pipeline.front_end_config import FrontEndConfig, check_front_end
from digs_warp.pipeline.loaded_views import LoadedViews, load_views
from digs_warp.pipeline.prepared import Prepared
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.pipeline.refined_poses import with_trained_poses
from digs_warp.pipeline.results import Results
from digs_warp.pipeline.stored_views import write_render, write_scores
from digs_warp.poses.refinement import PoseRefinement
from digs_warp.record.files import remove
from digs_warp.record.layout import (
    CHECKPOINT,
    COURSE,
    GAUSSIANS,
    INITIAL_POINTS,
    RUN_RECORD,
    TRAINED_POSES,
    TRAINING,
)
from digs_warp.record.lock import sole_writer
from digs_warp.record.manifest import is_kept, recorded_files
from digs_warp.record.run_log import RunLog, RunRecord
from digs_warp.splat.device import DeviceGaussians
from digs_warp.surface.error import SurfaceError
from digs_warp.surface.rendered import surface_error
from digs_warp.surface.true_surface import read_true_surface
from digs_warp.train.blur_plan import plan_blur
from digs_warp.train.config import TrainConfig
from digs_warp.train.course import read_course
from digs_warp.train.evaluate import measure_views
from digs_warp.train.session import (
    Trained,
    Watch,
    load_trained_poses,
    train_gaussians,
)
from digs_warp.train.shutter import ShutterPlan, plan_shutter, with_motions
from digs_warp.train.trained_poses import PoseTraining

logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class ReconstructConfig(FrontEndConfig):
    """How a capture becomes Gaussians."""

    train: TrainConfig = field(default_factory=TrainConfig)


def reconstruct(
    capture: Capture,
    config: ReconstructConfig,
    folder: Path,
    resume: bool = False,
    watch: Watch | None = None,
    recommended: Mapping[str, Any] | None = None,
) -> Reconstruction:
    """Reconstruct a capture and save each part of the result to ``folder`` as soon as it is finished.

    Args:
        capture: the recording; held-out views are used neither for initialization nor for training.
        config: settings; with ``resume`` they must be those of the interrupted run.
        folder: where results go; created when missing.
        resume: keep finished stages, and continue from the last checkpoint, bit for bit.
        watch: looks on while the Gaussians are trained; None: nobody does.
        recommended: how the settings were chosen, for run.json; None: the user chose them.

    Raises:
        DigsError: no such device or library, too few frames, nothing to initialize from, settings that
            differ on resume, or a folder that another process is writing.
    """
    check_machine(config)
    folder = Path(folder)
    if not resume:  # else finished stages need nothing, and the others check
        check_front_end(capture, config)
    log = RunLog("reconstruct", config, recommended=dict(recommended or {}))
    with sole_writer(folder):
        before = log.continue_from(folder / RUN_RECORD) if resume else None
        with recorded_files(folder, resume) as manifest:
            _drop_what_follows(manifest.drop_damaged(), folder)
            return _reconstruct(capture, config, folder, log, before, watch)


def check_machine(config: ReconstructConfig) -> None:
    """Raise a `DigsError` when this machine lacks the device or a library that the settings need."""
    require_device(config.train.device)
    if config.needs_sfm:
        import_pycolmap()
    if config.sfm.poses == "rgbd":
        import_open3d()


def _drop_what_follows(lost: Sequence[str], folder: Path) -> None:
    """Delete what was made from lost files, or cannot be continued without them; it is made again."""
    first = {name.split("/")[0] for name in lost}
    if first & {CAMERAS, MASKS, SFM}:
        remove(folder / INITIAL_POINTS)
    if first & {TRAINING, COURSE, GAUSSIANS, TRAINED_POSES} and (
        TRAINED_POSES in first or (folder / TRAINED_POSES).is_file()
    ):  # cameras.json has the poses of the end, and the training starts from others
        remove(folder / TRAINED_POSES)
        remove(folder / INITIAL_POINTS)
    if first & {TRAINING, COURSE, TRAINED_POSES}:
        remove(folder / GAUSSIANS)
        remove(folder / CHECKPOINT)


def _reconstruct(
    capture: Capture,
    config: ReconstructConfig,
    folder: Path,
    log: RunLog,
    before: RunRecord | None,
    watch: Watch | None,
) -> Reconstruction:
    record = folder / RUN_RECORD
    resume = before is not None
    log.results = before.results if before else {}
    log.save(record)
    with decoded_once():
        with log.saved(record):
            prepared = front_end(capture, config, folder, log, resume)
        prepared, shutter = _with_shutter(capture, prepared, config)
        trained = (
            _finished_training(folder, before, len(prepared.frames.by_time)) if before else None
        )
        with log.stage("load views"):
            seeds = _seeds(prepared, config) if trained is None else None
            views = load_views(prepared, seeds, shutter, config.train, folder, resume)
    test_views, color = views.held_out, views.color
    if color is not None:
        config = replace(config, train=replace(config.train, sh_degree=color.degree))
    with log.saved(record):
        if trained is None:
            assert seeds is not None
            trained = _train(prepared, seeds, views, config, folder, log, watch)
        prepared, test_views = with_trained_poses(prepared, test_views, trained.poses, folder)
        result = Reconstruction(
            gaussians=trained.gaussians,
            frames=prepared.frames,
            start=prepared.start,
            scale=prepared.scale,
            sfm=prepared.sfm,
            course=trained.course,
            stopped_by=trained.stopped_by,
            exposure_stops=trained.exposure_stops,
            tone_lift=trained.tone_lift,
            folder=folder,
            capture=capture.stored_in,
            doubts=prepared.doubts,
            subject=prepared.subject,
            metric_scale=prepared.metric_scale,
            refinement=prepared.refinement,
            tracking=prepared.tracking,
            shutter=shutter,
            color=color,
        )
        log.results = result.results.to_json()
    with log.stage("evaluate"), ThreadPoolExecutor(default_threads()) as beside:
        truth = beside.submit(_true_surface, result, config)
        measured = trained.measured
        if measured is None:
            gaussians = DeviceGaussians.from_numpy(trained.gaussians, config.train.device)
            measured = measure_views(gaussians, test_views)
        pairs = zip(test_views, measured.renderings, strict=True)
        writes = [beside.submit(write_render, folder, view.name, one.image) for view, one in pairs]
        surface = _surface_error(result, truth.result(), config)
        for write in writes:
            write.result()
        scores = Scores(tuple(measured.scores))
        write_scores(folder, scores)
    result = replace(result, scores=scores, surface=surface)
    log.results = result.results.to_json()
    log.save(record)
    return replace(result, run=log.record())


def _with_shutter(
    capture: Capture, prepared: Prepared, config: ReconstructConfig
) -> tuple[Prepared, ShutterPlan]:
    """Return the frames with what is known of their motion, and whether the training draws it."""
    readout_time = config.sfm.readout_time
    if readout_time is None:
        readout_time = capture.readout_time
    frames, training = prepared.frames, len(prepared.frames.training)
    every = with_motions([*frames.training, *frames.held_out])
    points, train = prepared.start.points.points_world, config.train
    plan = plan_shutter(every, points, readout_time, train.rolling_shutter)
    plan = replace(plan, blur=plan_blur(every, points, train.exposure_time, train.motion_blur))
    moving = replace(frames, training=tuple(every[:training]), held_out=tuple(every[training:]))
    return replace(prepared, frames=moving), plan


def _seeds(prepared: Prepared, config: ReconstructConfig) -> Gaussians:
    """Return the Gaussians to start from, in the colors of the first points."""
    start = seed_start(config.init, prepared.subject, config.train.stop.iterations)
    return seed_gaussians(prepared.start.points, config.train.usual_sh_degree, *start)


def _train(
    prepared: Prepared,
    seeds: Gaussians,
    views: LoadedViews,
    config: ReconstructConfig,
    folder: Path,
    log: RunLog,
    watch: Watch | None,
) -> Trained:
    seeds = with_colors(seeds, views.points.colors, config.train.usual_sh_degree)
    assert views.data is not None
    return train_gaussians(
        *(seeds, views.data, views.held_out, config.train, folder, log, watch),
        held=views.points.hidden,
        train_poses=pose_training(prepared.refinement, config.train),
    )


def pose_training(refinement: PoseRefinement | None, config: TrainConfig) -> PoseTraining:
    """Return what the cameras do in the training: centers that a bundle adjustment found are held."""
    if refinement is None or not refinement.in_training or config.mask_role != "object":
        return "held"
    return "turned" if refinement.adjusted else "moved"


def _finished_training(folder: Path, before: RunRecord, frames: int) -> Trained | None:
    """Return the finished training of an earlier run, if there is one."""
    if not is_kept(folder / GAUSSIANS):
        return None
    known = Results.read(before, folder / RUN_RECORD)
    poses = load_trained_poses(folder, frames)
    gaussians, course = Gaussians.load(folder / GAUSSIANS), read_course(folder / TRAINING)
    found = known.stopped_by, known.exposure_stops, known.tone_lift
    return Trained(gaussians, course, *found, poses)


def _true_surface(result: Reconstruction, config: ReconstructConfig) -> TriangleMesh | None:
    """Return the true surface, where the recording is a simulated one and its mesh is still there."""
    if result.capture is None or result.frames is None or result.subject == "scene":
        return None  # the true mesh is that of the object: a room would be far from it
    try:
        return read_true_surface(result.capture, config.segment.instance, textured=False)
    except DigsError as error:
        logger.info("no distance to the true surface: %s", error)
        return None


def _surface_error(
    result: Reconstruction, truth: TriangleMesh | None, config: ReconstructConfig
) -> SurfaceError | None:
    if truth is None or result.frames is None:
        return None
    frames = (*result.frames.training, *result.frames.held_out)
    return surface_error(result.gaussians, frames, truth, config.train.device)
