"""A recording whose poses were found by color and depth, in a world whose axes mean something."""

import logging
from dataclasses import replace

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.tracking import Tracking

logger = logging.getLogger(__name__)


def tracked(capture: Capture, config: SfmConfig) -> tuple[Capture, Tracking]:
    """Return the recording with poses by color and depth, held-out frames included, and how well they fit.

    Nothing tells where gravity is. In a recording without poses z is up in the images, on average, and the
    origin is in the middle of what is near. Where the recording has poses, the found ones are laid over them
    by one rigid motion: nothing else is learnt from them.

    Raises:
        DigsError: frames without depth, or neighbors that do not show the same.
    """
    from digs_warp.poses.align import in_place
    from digs_warp.poses.from_images.world import upright_world
    from digs_warp.poses.track import track

    readout_time = config.readout_time
    if readout_time is None:
        readout_time = capture.readout_time
    found = track(capture.frames, readout_time)
    cameras = [frame.camera for frame in capture.frames]
    if capture.knows_poses:
        given = np.stack([camera.world_from_cam for camera in cameras])
        poses = in_place(found.poses, given, float(np.linalg.norm(found.middle)))
    else:
        placed = [
            replace(camera, world_from_cam=pose)
            for camera, pose in zip(cameras, found.poses, strict=True)
        ]
        poses = upright_world(placed, found.middle) @ found.poses
    frames = tuple(
        replace(frame, camera=replace(frame.camera, world_from_cam=pose))
        for frame, pose in zip(capture.frames, poses, strict=True)
    )
    logger.info("poses: %s", found.tracking)
    if not found.tracking.loops:
        logger.warning("%s: %s", capture, found.tracking)
    about = replace(capture.about, poses_known=True, poses_in_metres=True)
    return replace(capture, frames=frames, about=about), found.tracking
