"""Capture -> Gaussians: poses, initialization, training and evaluation, each stage cached and resumable.

docs/formats.md describes the folder that `reconstruct` writes.
"""

import logging
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.decoded import decoded_once
from digs_warp.data.images import write_image
from digs_warp.data.posed_frames import CAMERAS
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.device.libraries import import_open3d, import_pycolmap
from digs_warp.device.threads import default_threads
from digs_warp.device.warp_start import require_device
from digs_warp.measure.scores import Scores
from digs_warp.pipeline.config import ReconstructConfig, check_front_end
from digs_warp.pipeline.front_end import SFM, front_end
from digs_warp.pipeline.optimize import Optimized, optimize
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.pipeline.records import RENDERS
from digs_warp.pipeline.verdict import verdict
from digs_warp.record.files import remove, to_json, write_atomically
from digs_warp.record.layout import (
    CHECKPOINT,
    COURSE,
    EVALUATION,
    GAUSSIANS,
    INITIAL_POINTS,
    MASKS,
    RUN_RECORD,
    TRAINED_POSES,
    TRAINING,
)
from digs_warp.record.lock import sole_writer
from digs_warp.record.manifest import recorded_files
from digs_warp.record.run_log import RunLog, RunRecord
from digs_warp.splat.device import DeviceGaussians
from digs_warp.surface.rendered import surface_error
from digs_warp.surface.true_surface import read_true_surface
from digs_warp.train.evaluate import measure_views
from digs_warp.train.other_sizes import measure_other_sizes
from digs_warp.train.session import NO_HOOKS, Hooks
from digs_warp.train.unseen_part import unseen_part

logger = logging.getLogger(__name__)


def reconstruct(
    capture: Capture,
    config: ReconstructConfig,
    folder: Path,
    resume: bool = False,
    hooks: Hooks = NO_HOOKS,
) -> Reconstruction:
    """Reconstruct a capture and save each part of the result to ``folder`` as soon as it is finished.

    Args:
        capture: the recording; held-out views are used neither for initialization nor for training.
        config: settings; with ``resume`` they must be those of the interrupted run.
        folder: where results go; created when missing.
        resume: keep finished stages, and continue from the last checkpoint, bit for bit.
        hooks: what the caller adds to the training.

    Raises:
        DigsError: no such device or library, too few frames, nothing to initialize from, settings that
            differ on resume, or a folder that another process is writing.
    """
    check_machine(config)
    folder = Path(folder)
    if not resume:  # an interrupted run was checked when it began, and finished stages need nothing
        check_front_end(capture, config)
    log = RunLog("reconstruct", config)
    with sole_writer(folder):
        before = log.continue_from(folder / RUN_RECORD) if resume else None
        with recorded_files(folder, resume) as manifest:
            _drop_what_follows(manifest.drop_missing(), folder)
            return _reconstruct(capture, config, folder, log, before, hooks)


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
    hooks: Hooks,
) -> Reconstruction:
    path = folder / RUN_RECORD
    log.results = before.results if before else {}
    log.save(path)
    with decoded_once(), log.saved(path):
        poses, start = front_end(capture, config, folder, log, resume=before is not None)
        found = optimize(capture, poses, start, config, folder, log, before, hooks)
        result = Reconstruction(
            gaussians=found.trained.gaussians,
            poses=found.poses,
            start=start,
            training=found.trained.record,
            folder=folder,
            capture=capture.stored_in,
        )
        log.results = result.results
    with log.stage("evaluate"):
        result = replace(result, scores=_evaluate(result, found, config))
        measured = (result.poses, result.scores, result.training.adherence)
        judged = verdict(*measured, result.gaussians, capture.about, capture.rig)
        result = replace(result, verdict=judged)
    log.results = result.results
    log.save(path)
    return replace(result, run=log.record())


def _evaluate(result: Reconstruction, found: Optimized, config: ReconstructConfig) -> Scores:
    """Measure the held-out views at all sizes, keep their renders, and compare the surface with the truth."""
    assert result.folder is not None
    folder, trained = result.folder, found.trained
    with ThreadPoolExecutor(default_threads()) as beside:
        truth = beside.submit(_true_surface, result, config)
        gaussians = DeviceGaussians.from_numpy(trained.gaussians, config.train.device)
        measured = trained.measured or measure_views(gaussians, found.test_views)
        names = [score.name for score in measured.scores]
        writes = [
            beside.submit(write_image, folder / RENDERS / f"{name}.png", image)
            for name, image in zip(names, measured.images, strict=True)
        ]
        sizes = measure_other_sizes(gaussians, found.test_views, measured.scores)
        frames, mesh = result.poses.posed, truth.result()
        every = (*frames.training, *frames.held_out)
        device, surface, unseen = config.train.device, None, None
        if mesh is not None:
            surface = surface_error(trained.gaussians, every, mesh, device)
        if result.poses.subject == "scene":
            unseen = unseen_part(measured, frames, found.test_views)
        for write in writes:
            write.result()
        scores = Scores.of(measured.scores, surface, sizes, unseen)
        write_atomically(folder / EVALUATION, to_json(scores.to_json()).encode())
    return scores


def _true_surface(result: Reconstruction, config: ReconstructConfig) -> TriangleMesh | None:
    """Return the true surface, where the recording is a simulated one and its mesh is still there."""
    if result.capture is None or result.poses.subject == "scene":
        return None  # the true mesh is that of the object: a room would be far from it
    try:
        return read_true_surface(result.capture, config.segment.instance, textured=False)
    except DigsError as error:
        logger.info("no distance to the true surface: %s", error)
        return None
