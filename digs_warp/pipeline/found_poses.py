"""Which way finds the poses: from images, or from color and depth where images alone fail or mislead."""

import logging
from dataclasses import replace
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.device.libraries import MissingLibraryError
from digs_warp.init.config import InitConfig
from digs_warp.pipeline.matched_images import in_metres, match_images, registered
from digs_warp.pipeline.tracked_poses import tracked
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.tracking import Tracking
from digs_warp.words import counted

logger = logging.getLogger(__name__)


def chosen_way(
    capture: Capture, split: PosedFrames, sfm: SfmConfig, init: InitConfig, workspace: Path
) -> tuple[SfmConfig, Capture, Tracking | None]:
    """Return how poses are found instead of "auto", and the recording with them if by color and depth.

    Images are matched first. If that fails, or if depth contradicts the poses, color and depth find them; if
    these fail as well, the poses from images stay, or their error is raised.

    Args:
        capture: the recording.
        split: its frames; their depth gives the scale.
        sfm: the settings.
        init: how the scale is found.
        workspace: folder of structure from motion; what is finished there is used again.

    Raises:
        DigsError: no way finds poses.
    """
    by_images, by_depth = replace(sfm, poses="sfm"), replace(sfm, poses="rgbd")
    failure: DigsError | None = None
    try:
        sparse = match_images(capture, by_images, workspace)
        model = in_metres(sparse, capture, split, init)
        reason = depth_doubt(capture, registered(split, model), sfm)
    except MissingLibraryError:
        raise
    except DigsError as error:
        reason, failure = str(error), error
    if not reason or not all(frame.has(Layer.DEPTH) for frame in capture.frames):
        if failure is not None:
            raise failure
        return by_images, capture, None
    logger.warning("%s; trying color and depth (--poses rgbd)", reason)
    try:
        return by_depth, *tracked(capture, by_depth)
    except DigsError as error:
        if failure is not None:
            raise DigsError(f"{error}; and before that: {failure}") from error
        logger.warning("%s; going on with --poses sfm", error)
        return by_images, capture, None


def depth_doubt(capture: Capture, frames: PosedFrames, sfm: SfmConfig) -> str:
    """Return why poses from images are doubtful: depth shows other motions between neighbors; or "".

    Images can agree on wrong poses, as before a wall whose pattern repeats. Without Open3D or depth nothing
    is measured.

    Args:
        capture: the recording.
        frames: with its poses, in metres.
        sfm: the settings.
    """
    from digs_warp.poses.contradiction import contradiction

    deep = [frame for frame, _ in frames.by_time if frame.has(Layer.DEPTH)]
    readout_time = capture.readout_time if sfm.readout_time is None else sfm.readout_time
    try:
        found = contradiction(deep, readout_time)
    except MissingLibraryError as error:
        logger.info("poses: not compared with depth: %s", error)
        return ""
    logger.info(
        *("poses: depth contradicts %d of %s", found.contradicted, counted(found.steps, "step")),
    )
    if not found.is_doubtful:
        return ""
    return (
        f"structure from motion: color and depth show another motion at {found.contradicted} of "
        f"{counted(found.steps, 'step')} between neighbors: matched images may mislead, as before a pattern "
        "that repeats"
    )
