"""Refines the poses of a reconstruction's frames, where the settings and the recording call for it."""

import logging
from dataclasses import replace

from digs_warp.data.capture import Capture
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.poses.refinement import PoseRefinement
from digs_warp.sfm.config import SfmConfig

logger = logging.getLogger(__name__)


def refined(
    frames: PosedFrames, capture: Capture, config: SfmConfig
) -> tuple[PosedFrames, PoseRefinement]:
    """Return the frames with refined poses, where they need it; held-out ones are refined with the others.

    Raises:
        DigsError: "on", and the frames have no depth, or do not hold together.
    """
    from digs_warp.poses.refine import refine

    if config.refine_poses == "off":
        return frames, PoseRefinement(False, "--refine-poses off")
    if config.refine_poses == "auto" and capture.about.tier and config.poses == "capture":
        return frames, PoseRefinement(False, "the poses are those of a simulation")
    if config.refine_poses == "auto" and config.poses == "rgbd":
        return frames, PoseRefinement(False, "the poses were aligned when they were found")
    readout_time = config.readout_time
    if readout_time is None:
        readout_time = capture.readout_time or 0.0
    every = [*frames.training, *frames.held_out]
    posed, refinement = refine(every, readout_time, needed=config.refine_poses == "on")
    logger.info("poses: %s", refinement)
    count = len(frames.training)
    new = replace(frames, training=tuple(posed[:count]), held_out=tuple(posed[count:]))
    return new, refinement
