"""The settings from a capture to Gaussians, and what can be checked of them before any work."""

import logging
from dataclasses import dataclass, field
from typing import Literal

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.init.config import InitConfig
from digs_warp.init.start import Subject
from digs_warp.masks.config import SegmentConfig
from digs_warp.masks.masks import check_inputs
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.outcome import check_depth
from digs_warp.train.config import TrainConfig

logger = logging.getLogger(__name__)

SubjectChoice = Literal["auto", "object", "scene"]


def subject_of(capture: Capture, choice: SubjectChoice, masks: SegmentConfig) -> Subject:
    """Return what a run reconstructs; 'auto' decides by the masks.

    Raises:
        DigsError: a whole scene, together with --masks or --instance.
    """
    makes_masks = masks.source != "capture"
    if choice == "scene" and makes_masks:
        flag = (
            f"--masks {masks.masks}" if masks.instance is None else f"--instance {masks.instance}"
        )
        raise DigsError(f"--subject scene: no masks are used; leave out {flag}")
    if choice != "auto":
        return choice
    has_masks = any(frame.has(Layer.MASK) for frame in capture.frames)
    return "object" if makes_masks or has_masks else "scene"


def say_subject(capture: Capture, choice: SubjectChoice, subject: Subject) -> None:
    """Log the decision where the user left it open, and the recording has no masks."""
    if choice == "auto" and subject == "scene":
        logger.info(
            "%s: no masks, so everything in view is reconstructed (--subject scene). For one object in "
            "front of a background, add --masks depth",
            capture,
        )


@dataclass(frozen=True, kw_only=True)
class FrontEndConfig:
    """How a capture becomes posed frames and points."""

    sfm: SfmConfig = field(default_factory=lambda: SfmConfig(poses="capture"))
    segment: SegmentConfig = field(default_factory=SegmentConfig)
    init: InitConfig = field(default_factory=InitConfig)
    subject: SubjectChoice = "auto"
    """What is reconstructed. object: what lies in the masks; scene: everything in view; auto: the object if
    the recording has masks or --masks makes some, else the scene."""
    test_every: int = 8
    """The middle one of every n views is held out for the evaluation."""

    @property
    def needs_sfm(self) -> bool:
        """Whether images are matched: for the poses, or for sparse points, unless the recording has some."""
        return self.sfm.poses in ("sfm", "auto") or self.init.needs_sfm

    def takes_sparse_points(self, subject: Subject) -> bool:
        """Whether images are matched, unless sparse points are at hand; an object's hull does, too."""
        return self.needs_sfm or (self.init.strategy == "mvs" and subject == "scene")

    @property
    def takes_recorded_points(self) -> bool:
        """Whether sparse points that came with the recording do instead."""
        return self.sfm.poses == "capture" and self.init.takes_recorded_points


@dataclass(frozen=True, kw_only=True)
class ReconstructConfig(FrontEndConfig):
    """How a capture becomes Gaussians."""

    train: TrainConfig = field(default_factory=TrainConfig)


def check_front_end(capture: Capture, config: FrontEndConfig) -> None:
    """Check what can be checked before any work.

    Raises:
        DigsError: no poses, too few frames, or masks or their source are missing.
    """
    if not capture.knows_poses and config.sfm.poses == "capture":
        other = ", or with --poses rgbd from color and depth" if capture.has_depth else ""
        raise DigsError(
            f"{capture}: the recording has no camera poses; estimate them with --poses sfm{other}"
        )
    if config.sfm.poses == "rgbd":
        check_depth(capture.frames)
    _check_instance(capture, config.segment.instance)
    training = PosedFrames.split(capture, config.test_every).training
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
