"""Refines poses where settings and recording call for it, and leaves out frames that have no right pose."""

import logging
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame, posed_at
from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.poses import thresholds
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.from_images.quality import SfmQuality
from digs_warp.poses.outcome import PoseRefinement
from digs_warp.train.evaluate import TestViews
from digs_warp.words import counted, first_few

logger = logging.getLogger(__name__)


def only_registered(frames: PosedFrames, names: Collection[str]) -> PosedFrames:
    """Return the frames that structure from motion has placed, ``names``; warn about the others."""
    lost = [frame.name for frame, _ in frames.by_time if frame.name not in names]
    if not lost:
        return frames
    logger.warning(
        "not registered and left out: %s (%s)", counted(len(lost), "frame"), first_few(lost)
    )
    return frames.named(names)


def refined(
    frames: PosedFrames, capture: Capture, config: SfmConfig, matched: SfmQuality | None = None
) -> tuple[PosedFrames, PoseRefinement]:
    """Return the frames with refined poses, where they need it; held-out ones are refined with the others.

    Frames that agree with no other are left out, with a warning. Without depth, cameras move in the training
    where features, ``matched`` under the given poses, miss them.

    Raises:
        DigsError: "on", and the frames have no depth, or do not hold together.
    """
    if config.refine_poses == "off":
        return frames, PoseRefinement(False, "--refine-poses off")
    if config.refine_poses == "auto" and capture.about.tier and config.poses == "capture":
        return frames, PoseRefinement(False, "the poses are those of a simulation")
    if config.refine_poses == "auto" and config.poses == "rgbd":
        because = "the poses were aligned when they were found"
        return frames, PoseRefinement(False, because, in_training=True)
    from digs_warp.poses.refine.refine import refine  # has kernels, and simulated poses need none

    held_out = {frame.name for frame in frames.held_out}
    every = [frame for frame, _ in frames.by_time]
    with_depth = any(frame.has(Layer.DEPTH) for frame in every)
    # Without depth the training alone can mend them.
    estimated = config.poses == "sfm" or config.board is not None
    needed = config.refine_poses == "on" and with_depth
    posed, refinement = refine(every, config.readout, needed, estimated)
    left = {frame.name for frame in posed}
    lost = [frame.name for frame in every if frame.name not in left]
    if lost:
        logger.warning(
            "poses contradicted by color and depth, and left out: %s (%s)",
            *(counted(len(lost), "frame"), first_few(lost)),
        )
    # Estimated poses are never exact; those of a recording may be, and then moving only adds noise.
    wanted = config.refine_poses == "on" or estimated
    # A rolling shutter moves features, too, however right the poses are.
    missed = "" if wanted or with_depth or config.readout else _missed(matched, every)
    refinement = replace(
        refinement,
        because=refinement.because + missed,
        in_training=wanted or refinement.refined or bool(missed),
    )
    logger.info("poses: %s", refinement)
    training = tuple(frame for frame in posed if frame.name not in held_out)
    aside = tuple(frame for frame in posed if frame.name in held_out)
    return replace(frames, training=training, held_out=aside), refinement


def _missed(matched: SfmQuality | None, frames: Sequence[Frame]) -> str:
    """Return why cameras have to move: features lie too far from where the poses put them; or ""."""
    if matched is None or matched.observations_per_image < thresholds.MIN_OBSERVATIONS:
        return ""
    k, error = frames[0].camera.intrinsics, matched.reprojection_error_px
    if error <= max(thresholds.MAX_MISFIT_PX, thresholds.MAX_MISFIT * max(k.width, k.height)):
        return ""
    return (
        f"; matched features miss the poses by {error:.2f} px, so cameras move in the training "
        "(--refine-poses off holds them)"
    )


def with_trained_poses(
    frames: PosedFrames, views: TestViews, poses: np.ndarray | None, folder: Path
) -> tuple[PosedFrames, TestViews]:
    """Return frames and held-out views with the poses that the training found, and write cameras.json.

    Args:
        frames: that the training started from.
        views: of the held-out frames.
        poses: of the training frames, then the held-out ones, (n, 4, 4); None: they were not trained.
        folder: of the reconstruction.
    """
    if poses is None:
        return frames, views
    count = len(frames.training)
    training, held_out = (
        tuple(posed_at(*each))
        for each in ((frames.training, poses[:count]), (frames.held_out, poses[count:]))
    )
    new = replace(frames, training=training, held_out=held_out)
    new.save(folder)
    pairs = zip(views.cameras, poses[count:], strict=True)
    return new, views.seen_from([replace(camera, world_from_cam=pose) for camera, pose in pairs])
