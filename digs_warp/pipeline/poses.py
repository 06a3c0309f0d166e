"""How a capture gets its poses, in metres: from images, from color and depth, or from what fits better.

`match_images` estimates them by structure from motion, `in_metres` scales that by the depth; `tracked` takes
color and depth from frame to frame; `chosen_way` decides between them for `--poses auto`.
"""

import logging
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from digs_warp.check.recording import moved
from digs_warp.checks import DigsError
from digs_warp.data.capture import BY_DEPTH, SCALE_IT, Capture, MetricScale
from digs_warp.data.frame import posed_at
from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.data.sfm_model import SfmModel
from digs_warp.data.viewpoints import looked_at
from digs_warp.device.libraries import MissingLibraryError
from digs_warp.geometry.camera import Camera
from digs_warp.init.config import InitConfig
from digs_warp.init.scale import ScaleEstimate, estimate_scale, local_scales
from digs_warp.poses import thresholds
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.outcome import Tracking
from digs_warp.words import counted

if TYPE_CHECKING:
    from digs_warp.poses.from_images.estimate import SfmResult


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
        reason = depth_contradiction(registered(split, model), sfm)
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


@dataclass(frozen=True, eq=False)
class MetricModel:
    """Structure from motion in metres, and its original scale; 1 for given poses and for an unknown one."""

    sfm: SfmModel
    sfm_per_metre: float
    estimate: ScaleEstimate | None = None


def match_images(capture: Capture, config: SfmConfig, workspace: Path) -> "SfmResult":
    """Estimate the poses of all frames, held-out ones included: evaluation needs their poses.

    Raises:
        DigsError: as of `digs_warp.poses.from_images.estimate.structure_from_motion`.
    """
    from digs_warp.poses.from_images.estimate import structure_from_motion

    try:
        return structure_from_motion(capture.frames, config, workspace)
    except MissingLibraryError:
        raise
    except DigsError as error:
        if config.poses != "sfm" or not capture.has_depth:
            raise
        raise DigsError(f"{error}; or use the depth of a film, too: --poses rgbd") from error


def in_metres(
    sparse: "SfmResult", capture: Capture, frames: PosedFrames, config: InitConfig
) -> MetricModel:
    """Scale the model by the depth maps (eq. 6 and 7), and choose its world; without depth its unit stays."""
    if sparse.is_metric:
        return MetricModel(sparse.model, 1.0)
    if not capture.has_depth:
        return MetricModel(sparse.model.moved(_world(sparse.model, capture)), 1.0)
    ratios = local_scales(sparse.model, frames.training, config)
    scale = estimate_scale(ratios)
    sfm = sparse.model.in_metres(scale.sfm_per_metre)
    return MetricModel(sfm.moved(_world(sfm, capture)), scale.sfm_per_metre, scale)


def _world(sfm: SfmModel, capture: Capture) -> np.ndarray:
    """Return the rigid motion, (4, 4), into the recording's world, or into an upright one."""
    from digs_warp.poses.from_images.similarity import upright_world, world_as_recorded

    if not capture.knows_poses:
        return upright_world(sfm.cameras, looked_at(sfm.cameras))
    recorded = {frame.name: frame.camera for frame in capture.frames}
    if _only_object_turns(capture):
        return _in_first(sfm.cameras[0], recorded[sfm.names[0]])
    return world_as_recorded(sfm.cameras, [recorded[name] for name in sfm.names])


def _only_object_turns(capture: Capture) -> bool:
    return capture.frames[0].alone and not moved(capture.frames)


def _in_first(found: Camera, recorded: Camera) -> np.ndarray:
    """Return the motion, (4, 4), into the world as it was in the first frame: later the object has turned."""
    return recorded.world_from_cam @ found.cam_from_world


def registered(frames: PosedFrames, model: MetricModel) -> PosedFrames:
    """Return the frames that the model has a camera for, with that camera."""
    cameras = dict(zip(model.sfm.names, model.sfm.cameras, strict=True))
    known = frames.named(cameras).changed(lambda frame: replace(frame, camera=cameras[frame.name]))
    return replace(known, sfm_per_metre=model.sfm_per_metre)


def tracked(capture: Capture, config: SfmConfig) -> tuple[Capture, Tracking]:
    """Return the recording with poses by color and depth, held-out frames included, and how well they fit.

    Nothing tells where gravity is. In a recording without poses z is up in the images, on average, and the
    origin is in the middle of what is near. Where the recording has poses, the found ones are laid over them
    by one rigid motion: nothing else is learnt from them.

    Raises:
        DigsError: frames without depth, or neighbors that do not show the same.
    """
    from digs_warp.poses.from_depth.estimate import track
    from digs_warp.poses.from_images.similarity import on_one_axis, upright_world
    from digs_warp.poses.refine.photometric_alignment import in_place

    found = track(capture.frames, config.readout)
    turns, poses = _only_object_turns(capture), found.poses
    if turns:
        poses = on_one_axis(poses)
    placed = [frame.camera for frame in posed_at(capture.frames, poses)]
    given = np.stack([frame.camera.world_from_cam for frame in capture.frames])
    if not capture.knows_poses:
        poses = upright_world(placed, found.middle) @ poses
    elif turns:
        poses = _in_first(placed[0], capture.frames[0].camera) @ poses
    else:
        poses = in_place(poses, given, float(np.linalg.norm(found.middle)))
    frames = tuple(posed_at(capture.frames, poses))
    logger.info("poses: %s", found.tracking)
    if not found.tracking.loops:
        logger.warning("%s: %s", capture, found.tracking)
    about = replace(capture.about, poses_known=True, poses_in_metres=True, world_offset=None)
    return replace(capture, frames=frames, about=about), found.tracking


def depth_contradiction(frames: PosedFrames, sfm: SfmConfig) -> str:
    """Return why poses from images are doubtful: depth shows other motions between neighbors; or "".

    Images can agree on wrong poses, as before a wall whose pattern repeats. Without Open3D or depth nothing
    is measured.

    Args:
        frames: with poses of the images, in metres.
        sfm: the settings.
    """
    from digs_warp.poses.from_depth.estimate import contradicted_steps

    deep = [frame for frame, _ in frames.by_time if frame.has(Layer.DEPTH)]
    try:
        contradicted, steps = contradicted_steps(deep, sfm.readout)
    except MissingLibraryError as error:
        logger.info("poses: not compared with depth: %s", error)
        return ""
    logger.info("poses: depth contradicts %d of %s", contradicted, counted(steps, "step"))
    if contradicted <= thresholds.MAX_CONTRADICTED_SHARE * steps:
        return ""
    return (
        f"structure from motion: color and depth show another motion at {contradicted} of "
        f"{counted(steps, 'step')} between neighbors: matched images may mislead, as before a pattern "
        "that repeats"
    )


def metric_scale_of(capture: Capture, estimated: bool) -> MetricScale:
    """Return what is known about the scale of a reconstruction; ``estimated``: whether its poses were."""
    if estimated and not capture.has_depth:
        return MetricScale(False, f"the poses were estimated without depth; {SCALE_IT}")
    return BY_DEPTH if capture.has_depth else capture.metric_scale
