"""What matching the images of a recording contributes: cameras and sparse points, in metres."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.posed_frames import PosedFrames, with_cameras
from digs_warp.data.sfm_model import SfmModel
from digs_warp.data.viewpoints import looked_at
from digs_warp.device.libraries import MissingLibraryError
from digs_warp.init.config import InitConfig
from digs_warp.init.local_scales import local_scales
from digs_warp.init.scale import ScaleEstimate, estimate_scale
from digs_warp.poses.from_images.config import SfmConfig

if TYPE_CHECKING:
    from digs_warp.poses.from_images.estimate import SfmResult


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

    if config.readout_time is None:
        config = replace(config, readout_time=capture.readout_time)
    if config.poses == "rgbd":  # these are known by now
        config = replace(config, poses="capture")
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
    scale = estimate_scale(ratios, config.scale)
    sfm = sparse.model.in_metres(scale.sfm_per_metre)
    return MetricModel(sfm.moved(_world(sfm, capture)), scale.sfm_per_metre, scale)


def _world(sfm: SfmModel, capture: Capture) -> np.ndarray:
    """Return the rigid motion, (4, 4), into the recording's world, or into an upright one."""
    from digs_warp.poses.from_images.world import upright_world, world_as_recorded

    if not capture.knows_poses:
        return upright_world(sfm.cameras, looked_at(sfm.cameras))
    recorded = {frame.name: frame.camera for frame in capture.frames}
    return world_as_recorded(sfm.cameras, [recorded[name] for name in sfm.names])


def registered(frames: PosedFrames, model: MetricModel) -> PosedFrames:
    """Return the frames that the model has a camera for, with that camera.

    Raises:
        DigsError: no frame to train on is among them.
    """
    training, held_out = (
        tuple(with_cameras(group, model.sfm)) for group in (frames.training, frames.held_out)
    )
    if not training:
        raise DigsError(
            f"structure from motion: none of the {len(frames.training)} training frames was registered"
        )
    return PosedFrames(training, held_out, model.sfm_per_metre)
