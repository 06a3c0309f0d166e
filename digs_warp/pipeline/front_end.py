"""Capture -> posed frames with masks, and the points to start from (paper sections 3.1 to 3.3).

The order follows the paper: structure from motion uses whole images, background included; then come the
masks; the depth maps inside them give the scale; from then on everything is metric.
"""

import logging
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from digs_warp.check import recording
from digs_warp.check.check import check_capture
from digs_warp.check.evidence import Evidence
from digs_warp.check.findings import limit_of
from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture, object_alone
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.posed_frames import CAMERAS, PosedFrames
from digs_warp.device.libraries import MissingLibraryError
from digs_warp.init.recipes import initialize
from digs_warp.init.sparse_points import recorded_points
from digs_warp.init.start import Start, Subject
from digs_warp.masks.config import SegmentConfig
from digs_warp.masks.masks import masked
from digs_warp.masks.no_scene import without_no_scene
from digs_warp.pipeline.config import FrontEndConfig, say_subject, subject_of
from digs_warp.pipeline.poses import (
    MetricModel,
    chosen_way,
    depth_contradiction,
    in_metres,
    match_images,
    metric_scale_of,
    registered,
    tracked,
)
from digs_warp.pipeline.records import Poses, store, stored
from digs_warp.pipeline.refine_poses import only_registered, refined
from digs_warp.poses.board import posed_by_board
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.outcome import Tracking
from digs_warp.record.layout import INITIAL_POINTS, MASKS, RUN_RECORD
from digs_warp.record.manifest import is_kept
from digs_warp.record.run_log import RunLog, RunRecord

if TYPE_CHECKING:
    from digs_warp.check.findings import Finding
    from digs_warp.poses.from_images.estimate import SfmResult

logger = logging.getLogger(__name__)

SFM = "sfm"

# Recordings of at most this many frames are looked at frame by frame, which takes a second.
SHORT = 60


class FrontEnd(NamedTuple):
    """What the training starts from."""

    poses: Poses
    start: Start


def front_end(
    capture: Capture, config: FrontEndConfig, folder: Path, log: RunLog, resume: bool = False
) -> FrontEnd:
    """Return the frames as the reconstruction uses them, and the initial points.

    Also saves them to ``folder``, next to the workspace of structure from motion and new masks, if any, and
    what is known of them to the results of ``log``; ``resume`` reuses what is finished there.

    Args:
        capture: the recording, which `check_front_end` accepts.
        config: settings.
        folder: of the reconstruction.
        log: receives times and results.
        resume: whether ``folder`` is that of an interrupted run.

    Raises:
        DigsError: too few frames, a failed structure from motion, or nothing to initialize from.
    """
    if resume and is_kept(folder / INITIAL_POINTS) and is_kept(folder / CAMERAS):
        return load_front_end(capture, folder)
    stored_in = capture.stored_in
    config = replace(config, sfm=config.sfm.for_capture(capture))
    capture = without_no_scene(capture, config.segment.ignore_mask, folder / MASKS)
    capture, config = _alone_if_still(capture, config, folder)
    capture, sfm_config, tracking = _with_poses(capture, config, folder, log)
    config = replace(config, sfm=sfm_config)
    subject = subject_of(capture, config.subject, config.segment)
    say_subject(capture, config.subject, subject)
    # The check looks at small images with one core. It ends, and warns, also where other stages fail.
    with ThreadPoolExecutor(1, thread_name_prefix="check") as beside:
        check = beside.submit(_findings, capture, config)
        if config.needs_sfm or config.segment.source != "capture":
            with log.stage("check"):
                check.result()  # before what takes minutes
        poses, start = _poses_and_start(capture, config, subject, check, folder, log)
    poses = replace(poses, tracking=tracking)
    log.results = store(stored_in, poses=poses, start=start)
    log.save(folder / RUN_RECORD)
    poses.posed.save(folder)
    start.points.save(folder / INITIAL_POINTS)  # the last: tells a resumed run that all is there
    return FrontEnd(poses, start)


def load_front_end(capture: Capture, folder: Path) -> FrontEnd:
    """Return what `front_end` left in ``folder``.

    Raises:
        DigsError: a file is missing or broken.
    """
    record = RunRecord.find(folder)
    points = PointCloud.load(folder / INITIAL_POINTS)
    poses = stored(Poses, record, folder, frames=PosedFrames.load(capture, folder))
    return FrontEnd(poses, stored(Start, record, folder, points=points))


def _alone_if_still(
    capture: Capture, config: FrontEndConfig, folder: Path
) -> tuple[Capture, FrontEndConfig]:
    """Return the object alone, with its masks, where the surroundings stand still or show nothing."""
    given, moves = config.sfm.poses == "capture", recording.moved(capture.frames)
    subject = subject_of(capture, config.subject, config.segment)
    # A simulation has right poses, and a user who marks what moves with the camera knows what stands still.
    if given and moves and (capture.about.tier or config.segment.ignore_mask):
        return capture, config
    found = recording.stillness(capture.frames)
    if found is None or not (found.is_still or (found.is_bare and subject == "object")):
        return capture, config
    agreement = Evidence(capture).agreement if given and moves and subject == "scene" else None
    if agreement is not None and agreement.score > limit_of("agreement"):
        return capture, config  # the depth of everything in view fits the poses
    if found.is_still and (subject == "scene" or (given and not moves)):
        if not found.changes:
            return capture, config  # a camera that stands still before what stands still, too
        raise DigsError(
            f"{capture}: the camera stands still and something turns before it, so that poses can only be "
            "found from what lies inside the masks of the object: give masks (of the recording, or --masks) "
            "and --poses auto, or --poses board:FILE if a printed board turns with it. If a part of the "
            "camera is in view, such as a gripper, mark it with --ignore-mask"
        )
    if config.segment.source != "capture":
        split = PosedFrames.split(capture, config.test_every)
        frames = [frame for frame, _ in masked(split, config.segment, folder / MASKS).by_time]
        capture = replace(capture, frames=tuple(frames))
        config = replace(config, segment=SegmentConfig())
    if not all(frame.has(Layer.MASK) for frame in capture.frames):
        return capture, config
    logger.info("%s: of the poses, only what lies inside the masks tells", capture)
    if not moves and np.array_equal(capture.frames[0].camera.world_from_cam, np.eye(4)):
        capture = replace(capture, about=replace(capture.about, poses_known=False))
    return object_alone(capture), config


def _poses_and_start(
    capture: Capture,
    config: FrontEndConfig,
    subject: Subject,
    check: "Future[tuple[Finding, ...]]",
    folder: Path,
    log: RunLog,
) -> FrontEnd:
    """Return the frames of a recording whose poses are known, or are estimated from its images."""
    frames = PosedFrames.split(capture, config.test_every)
    recorded, sparse = _sparse_points(capture, frames, subject, config, folder, log)
    if sparse is not None:
        frames = only_registered(frames, sparse.model.names)
    if config.segment.source != "capture":
        with log.stage("masks"):
            frames = masked(frames, config.segment, folder / MASKS)
    if subject == "scene":
        frames = frames.changed(lambda frame: frame.without_layer(Layer.MASK))
    model: MetricModel | None = None
    findings: tuple[str, ...] = ()
    if sparse is not None:
        with log.stage("scale"):
            model = in_metres(sparse, capture, frames, config.init)
        frames = registered(frames, model)
        if config.sfm.poses == "sfm" and capture.has_depth:
            with log.stage("compare with depth"):
                finding = depth_contradiction(frames, config.sfm)
            if finding:
                logger.warning("%s: %s; --poses rgbd uses the depth", capture, finding)
                findings += (finding,)
    metric_scale = metric_scale_of(capture, config.sfm.poses == "sfm")
    if not metric_scale.known:
        logger.warning("%s: the scale is %s", capture, metric_scale)
    quality = sparse.quality if sparse else None
    with log.stage("refine poses"):
        frames, refinement = refined(frames, capture, config.sfm, quality)
    if not frames.held_out and capture.split(config.test_every)[1]:
        logger.warning("%s: no held-out frame is left, so the result is not measured", capture)
    frames = frames.changed(lambda frame: replace(frame, alone=False))
    with log.stage("check"):
        found = check.result()  # before the initialization, which counts its CPU time
    with log.stage("initialize"):
        sfm = model.sfm if model else None
        start = initialize(frames.training, config.init, sfm, subject, recorded)
    logger.info("%s: starting from %s", capture, start.because)
    poses = Poses(
        frames=frames,
        subject=subject,
        metric_scale=metric_scale,
        world_offset=capture.about.world_offset if sparse is None else None,
        findings=(*map(str, found), *findings),
        errors=tuple(each.kind for each in found if each.is_error),
        sfm=quality,
        scale=model.estimate if model else None,
        refinement=refinement,
    )
    return FrontEnd(poses, start)


def _with_poses(
    capture: Capture, config: FrontEndConfig, folder: Path, log: RunLog
) -> tuple[Capture, SfmConfig, Tracking | None]:
    """Return the recording with poses where color and depth find them, and how poses are found."""
    if config.sfm.board is not None:
        with log.stage("board"):
            frames = tuple(posed_by_board(capture.frames, config.sfm.board))
        about = replace(capture.about, poses_known=True, poses_in_metres=True)
        return replace(capture, frames=frames, about=about), config.sfm, None
    if config.sfm.poses == "rgbd":
        with log.stage("track"):
            found, tracking = tracked(capture, config.sfm)
        return found, config.sfm, tracking
    if config.sfm.poses == "auto":
        split = PosedFrames.split(capture, config.test_every)
        with log.stage("find poses"):
            way = chosen_way(capture, split, config.sfm, config.init, folder / SFM)
        sfm_config, found, tracking = way
        return found, sfm_config, tracking
    return capture, config.sfm, None


def _sparse_points(
    capture: Capture,
    frames: PosedFrames,
    subject: Subject,
    config: FrontEndConfig,
    folder: Path,
    log: RunLog,
) -> "tuple[PointCloud | None, SfmResult | None]":
    """Return the points that came with the recording or, without such, what matching images finds."""
    recorded: PointCloud | None = None
    if config.takes_recorded_points:
        recorded = recorded_points(capture, [frame.camera for frame in frames.training])
    if not config.takes_sparse_points(subject) or recorded is not None:
        return recorded, None
    with log.stage("structure from motion"):
        try:
            return None, match_images(capture, config.sfm, folder / SFM)
        except MissingLibraryError:
            raise
        except DigsError as error:
            if config.needs_sfm:
                raise
            logger.warning("%s", error)  # photographs of known poses can start without
            return None, None


def _findings(capture: Capture, config: FrontEndConfig) -> "tuple[Finding, ...]":
    """Take a first look at the parts of the capture that the settings use; warn of what does not fit."""
    uses_poses, uses_masks = config.sfm.poses != "sfm", config.segment.source == "capture"
    asker = "run" if uses_poses and len(capture) <= SHORT else "info"
    checked = check_capture(capture, asker, poses=uses_poses, masks=uses_masks)
    for finding in checked.findings:
        logger.warning("%s: %s", capture, finding)
    return checked.findings
