"""Capture -> posed frames with masks, and the points to start from (paper sections 3.1 to 3.3).

The order follows the paper: structure from motion uses whole images, background included; then come the
masks; the depth maps inside them give the scale; from then on everything is metric.
"""

import logging
from dataclasses import dataclass, field, replace
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.data.metric_scale import MetricScale
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.posed_frames import CAMERAS, PosedFrames
from digs_warp.init.config import InitConfig
from digs_warp.init.mono_config import MonoDepthConfig
from digs_warp.init.mono_depth import check_mono_depth, guessed_depth
from digs_warp.init.recipes import initialize
from digs_warp.init.recorded_points import recorded_points
from digs_warp.init.scale import ScaleEstimate
from digs_warp.init.start import Initialization, Subject
from digs_warp.pipeline.found_poses import chosen_way, depth_doubt
from digs_warp.pipeline.known_distance import check_scale_from, in_true_size, metric_scale_of
from digs_warp.pipeline.matched_images import MetricModel, in_metres, match_images, registered
from digs_warp.pipeline.refined_poses import refined
from digs_warp.pipeline.results import Results
from digs_warp.pipeline.subject import SubjectChoice, say_subject, subject_of
from digs_warp.pipeline.tracked_poses import tracked
from digs_warp.plausibility.check import check_capture
from digs_warp.poses.refinement import PoseRefinement
from digs_warp.poses.tracking import Tracking, check_depth
from digs_warp.record.layout import INITIAL_POINTS, RUN_RECORD
from digs_warp.record.manifest import is_kept
from digs_warp.record.run_log import RunLog, RunRecord
from digs_warp.segment.agreed import agreed_masks
from digs_warp.segment.config import SegmentConfig
from digs_warp.segment.masks import check_inputs, segment, with_masks
from digs_warp.sfm.config import SfmConfig
from digs_warp.sfm.quality import SfmQuality
from digs_warp.words import counted

logger = logging.getLogger(__name__)

SFM = "sfm"
MASKS = "masks"
HELD_OUT = "held_out"
MENDED = "mended"


@dataclass(frozen=True, kw_only=True)
class FrontEndConfig:
    """How a capture becomes posed frames and points."""

    sfm: SfmConfig = field(default_factory=lambda: SfmConfig(poses="capture"))
    segment: SegmentConfig = field(default_factory=SegmentConfig)
    init: InitConfig = field(default_factory=InitConfig)
    subject: SubjectChoice = "auto"
    """What is reconstructed. object: what lies in the masks; scene: everything in view; auto: the object if
    the recording has masks or --masks makes some, else the scene."""
    mono: MonoDepthConfig = field(default_factory=MonoDepthConfig)
    test_every: int = 8
    """Every n-th view, from the first on, is held out for the evaluation."""
    scale_from: str | None = None
    """Without depth: two frames and the distance of their cameras, such as 0000,0031=0.30m."""

    @property
    def needs_sfm(self) -> bool:
        """Whether images are matched: for the poses, or for sparse points, unless the recording has some."""
        is_scaled = self.mono.mono_depth is not None
        return self.sfm.poses in ("sfm", "auto", "perturbed") or self.init.needs_sfm or is_scaled

    @property
    def takes_recorded_points(self) -> bool:
        """Whether sparse points that came with the recording do instead."""
        is_scaled = self.mono.mono_depth is not None and not self.init.needs_sfm
        given = self.sfm.poses == "capture"
        return given and (self.init.takes_recorded_points or is_scaled)


@dataclass(frozen=True, eq=False)
class Prepared:
    """Everything that training starts from.

    Attributes:
        frames: with metric cameras and masks.
        start: the points, and where they come from.
        sfm: quality of structure from motion, where images were matched.
        scale: of the estimated poses; None for given ones.
        doubts: what does not fit together in the capture; see `digs_warp.plausibility`.
        subject: what is reconstructed; the frames of a scene have no masks.
        metric_scale: whether lengths are in metres, and how that is known; None where nothing says it.
        refinement: whether the poses were refined, and why.
        tracking: how well poses found by color and depth fit together, where they were.
    """

    frames: PosedFrames
    start: Initialization
    sfm: SfmQuality | None = None
    scale: ScaleEstimate | None = None
    doubts: tuple[str, ...] = ()
    subject: Subject = "object"
    metric_scale: MetricScale | None = None
    refinement: PoseRefinement | None = None
    tracking: Tracking | None = None

    @staticmethod
    def load(capture: Capture, folder: Path) -> "Prepared":
        """Read what `front_end` left in ``folder``.

        Raises:
            DigsError: a file is missing or broken.
        """
        record = RunRecord.find(folder)
        results = Results.read(record, folder / RUN_RECORD) if record else Results()
        start = results.start(PointCloud.load(folder / INITIAL_POINTS))
        frames = PosedFrames.load(capture, folder)
        return Prepared(
            frames,
            start,
            results.sfm,
            results.scale,
            results.doubts,
            results.subject,
            results.metric_scale,
            results.refinement,
            results.tracking,
        )


def check_front_end(capture: Capture, config: FrontEndConfig) -> None:
    """Check what can be checked before any work.

    Raises:
        DigsError: no poses, too few frames, or masks or their source are missing.
    """
    if not capture.knows_poses and config.sfm.poses not in ("sfm", "rgbd", "auto"):
        other = ", or with --poses rgbd from color and depth" if capture.has_depth else ""
        raise DigsError(
            f"{capture}: the recording has no camera poses; estimate them with --poses sfm{other}"
        )
    if config.sfm.poses == "rgbd":
        check_depth(capture.frames)
    check_scale_from(capture, config.scale_from)
    check_mono_depth(capture, config.mono)
    _check_instance(capture, config.segment.instance)
    training = _split(capture, config.test_every).training
    subject_of(capture, config.subject, config.segment)
    if config.segment.source != "capture":
        check_inputs(training, config.segment)


def _check_instance(capture: Capture, instance: int | None) -> None:
    objects = capture.about.objects
    if instance is None or objects is None or capture.about.instance(instance):
        return
    names = ", ".join(f"{number} {each.name}" for number, each in enumerate(objects, start=1))
    raise DigsError(
        f"--instance {instance}: {capture} has no such object; choose one of these: {names}"
    )


def front_end(
    capture: Capture, config: FrontEndConfig, folder: Path, log: RunLog, resume: bool = False
) -> Prepared:
    """Return the frames as the reconstruction uses them, and the initial points.

    Also saves them to ``folder``, next to the workspace of structure from motion and new masks, if any;
    ``resume`` reuses what is finished there.

    Raises:
        DigsError: too few frames, a failed structure from motion, or nothing to initialize from.
    """
    if resume and is_kept(folder / INITIAL_POINTS) and is_kept(folder / CAMERAS):
        return Prepared.load(capture, folder)
    check_front_end(capture, config)
    tracking: Tracking | None = None
    if config.sfm.poses == "rgbd":
        with log.stage("track"):
            capture, tracking = tracked(capture, config.sfm)
    frames = _split(capture, config.test_every)
    if config.sfm.poses == "auto":
        with log.stage("find poses"):
            way = chosen_way(capture, frames, config.sfm, config.init, folder / SFM)
        config, capture, tracking = replace(config, sfm=way[0]), *way[1:]
        frames = _split(capture, config.test_every)
    subject = subject_of(capture, config.subject, config.segment)
    say_subject(capture, config.subject, subject)
    with log.stage("check"):
        doubts = _doubts(capture, config)
    sparse, own = None, None
    if config.takes_recorded_points:
        own = recorded_points(capture, [frame.camera for frame in frames.training])
    if config.needs_sfm and own is None:
        with log.stage("structure from motion"):
            sparse = match_images(capture, config.sfm, folder / SFM)
    if config.segment.source != "capture":
        with log.stage("masks"):
            frames = _masked(frames, config.segment, folder / MASKS)
    if subject == "scene":
        frames = _without_masks(frames)
    model: MetricModel | None = None
    if sparse is not None:
        with log.stage("scale"):
            model = in_metres(sparse, capture, frames, config.init)
        frames = registered(frames, model)
        if config.sfm.poses == "sfm" and capture.has_depth:
            with log.stage("compare with depth"):
                doubt = depth_doubt(capture, frames, config.sfm)
            if doubt:
                logger.warning("%s: %s; --poses rgbd uses the depth", capture, doubt)
                doubts = (*doubts, doubt)
    if subject == "object" and config.segment.mends_masks:
        with log.stage("mask agreement"):
            training, doubt = agreed_masks(frames.training, folder / MASKS / MENDED)
        frames = replace(frames, training=tuple(training))
        doubts = (*doubts, doubt) if doubt else doubts
    if config.scale_from is not None:
        frames, model, own = in_true_size(frames, model, own, config.scale_from)
    scale = metric_scale_of(capture, config.sfm.poses == "sfm", config.scale_from)
    if not scale.known:
        logger.warning("%s: the scale is %s", capture, scale)
    with log.stage("refine poses"):
        frames, refinement = refined(frames, capture, config.sfm)
    start_from = frames.training
    if config.mono.mono_depth is not None:
        with log.stage("depth by a network"):
            sfm = model.sfm if model else None
            start_from = guessed_depth(frames.training, config.mono, sfm, own)
    with log.stage("initialize"):
        start = initialize(
            start_from,
            config.init,
            sfm=model.sfm if model else None,
            sfm_per_metre=model.sfm_per_metre if model else None,
            baseline=capture.right_offset,
            subject=subject,
            recorded=own,
        )
    if config.mono.mono_depth is not None and start.depth is not None:
        because = f"{start.because}, guessed by {config.mono.mono_depth.name}"
        start = replace(start, because=because)
    logger.info("%s: starting from %s", capture, start.because)
    prepared = Prepared(
        frames,
        start,
        sfm=sparse.quality if sparse else None,
        scale=model.estimate if model else None,
        doubts=doubts,
        subject=subject,
        metric_scale=scale,
        refinement=refinement,
        tracking=tracking,
    )
    _save(prepared, capture, folder, log)
    return prepared


def _save(prepared: Prepared, capture: Capture, folder: Path, log: RunLog) -> None:
    """Save everything to the folder; the points come last, to tell a resumed run that all is there."""
    results = Results.of_start(capture.stored_in, prepared.start, prepared.sfm, prepared.scale)
    results = replace(
        results,
        doubts=prepared.doubts,
        subject=prepared.subject,
        metric_scale=prepared.metric_scale,
        refinement=prepared.refinement,
        tracking=prepared.tracking,
    )
    log.results = results.to_json()
    log.save(folder / RUN_RECORD)
    prepared.frames.save(folder)
    prepared.start.points.save(folder / INITIAL_POINTS)


def _doubts(capture: Capture, config: FrontEndConfig) -> tuple[str, ...]:
    """Look at what the capture contributes, and warn of what does not fit together."""
    found = check_capture(
        capture, poses=config.sfm.poses != "sfm", masks=config.segment.source == "capture"
    )
    for doubt in found.doubts:
        logger.warning("%s: %s", capture, doubt)
    return found.doubts


def _split(capture: Capture, test_every: int) -> PosedFrames:
    training, held_out = capture.split(test_every)
    if not training:
        raise DigsError(
            f"{capture}: {counted(len(capture), 'frame')}, expected at least 2: one is held out for the "
            "evaluation"
        )
    return PosedFrames(tuple(training), tuple(held_out))


def _masked(frames: PosedFrames, config: SegmentConfig, folder: Path) -> PosedFrames:
    """Make masks for the frames. Held-out frames keep theirs: the evaluation must not use our own masks.

    The masks of one of several objects are those of the recording; the frames know that others may hide it.
    """
    training = with_masks(frames.training, segment(frames.training, config, folder))
    held_out = list(frames.held_out)
    if config.source == "instance" or any(not frame.has(Layer.MASK) for frame in held_out):
        held_out = with_masks(held_out, segment(held_out, config, folder / HELD_OUT))
    if config.instance is not None:
        training, held_out = (
            [replace(frame, instance=config.instance) for frame in group]
            for group in (training, held_out)
        )
    return replace(frames, training=tuple(training), held_out=tuple(held_out))


def _without_masks(frames: PosedFrames) -> PosedFrames:
    training, held_out = (
        tuple(frame.without_layer(Layer.MASK) for frame in group)
        for group in (frames.training, frames.held_out)
    )
    return replace(frames, training=training, held_out=held_out)
