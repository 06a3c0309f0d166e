"""COLMAP's model, which takes images for moments, corrected for a rolling shutter."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.sfm_model import SfmModel
from digs_warp.geometry.rigid import invert_rigid
from digs_warp.poses.from_images.colmap import ImageSet, quiet_pycolmap
from digs_warp.poses.from_images.model import sfm_model
from digs_warp.poses.from_images.rolling_shutter import (
    RollingModel,
    RollingViews,
    adjust,
    residuals,
    walking_spins,
)


def correct_rolling_shutter(
    reconstruction: Any, frames: Sequence[Frame], images: ImageSet, readout_time: float
) -> None:
    """Change poses and points of a model to those that fit images read row after row.

    Poses become those of the middle rows. Where features were measured stays as it is; the errors of the
    points are those that are left with the shutter taken into account.

    Args:
        reconstruction: a pycolmap.Reconstruction of these images.
        frames: all frames of the recording; their times have to rise.
        images: their names in COLMAP.
        readout_time: from the first to the last row [s], above 0.

    Raises:
        DigsError: times that do not rise.
    """
    model = sfm_model(reconstruction, frames, images)
    views = _views(model, frames, readout_time)
    adjusted = adjust(views, _start(views, model))
    errors = np.linalg.norm(residuals(views, adjusted), axis=1)
    _write_poses(reconstruction, dict(zip(images.names, frames, strict=True)), model, adjusted)
    _write_points(reconstruction, views, adjusted, errors)


def _views(model: SfmModel, frames: Sequence[Frame], readout_time: float) -> RollingViews:
    time_of = {frame.name: frame.time for frame in frames}
    times = np.array([time_of[name] for name in model.names])
    if not (np.diff(times) > 0).all():
        first = int(np.argmin(np.diff(times) > 0))
        raise DigsError(
            f"structure from motion: image '{model.names[first + 1]}' was taken at {times[first + 1]:g} s, "
            f"expected later than '{model.names[first]}' at {times[first]:g} s; correct the times of the "
            "recording, or give 0 for --readout-time"
        )
    intrinsics = [camera.intrinsics for camera in model.cameras]
    return RollingViews(
        focals=np.array([(k.fx, k.fy) for k in intrinsics]),
        centers=np.array([(k.cx, k.cy) for k in intrinsics]),
        heights=np.array([k.height for k in intrinsics]),
        times=times,
        readout_time=readout_time,
        cameras=model.observations.cameras,
        points=model.observations.points,
        px=model.observations.px.astype(np.float64),
    )


def _start(views: RollingViews, model: SfmModel) -> RollingModel:
    cams_from_world = np.array([invert_rigid(camera.world_from_cam) for camera in model.cameras])
    still = RollingModel(
        rotations=cams_from_world[:, :3, :3],
        translations=cams_from_world[:, :3, 3],
        spins=np.zeros((len(cams_from_world), 3)),
        points=model.points.points_world.astype(np.float64),
    )
    return replace(still, spins=walking_spins(views, still))


def _write_poses(
    reconstruction: Any, frame_of: dict[str, Frame], model: SfmModel, adjusted: RollingModel
) -> None:
    pycolmap = quiet_pycolmap()
    number = {name: index for index, name in enumerate(model.names)}
    for image in reconstruction.images.values():
        if not image.has_pose:
            continue
        index = number[frame_of[image.name].name]
        pose = np.column_stack([adjusted.rotations[index], adjusted.translations[index]])
        image.frame.set_cam_from_world(image.camera_id, pycolmap.Rigid3d(pose))


def _write_points(
    reconstruction: Any, views: RollingViews, adjusted: RollingModel, errors: np.ndarray
) -> None:
    count = len(adjusted.points)
    means = np.bincount(views.points, weights=errors, minlength=count)
    means /= np.maximum(1, np.bincount(views.points, minlength=count))
    for index, key in enumerate(sorted(reconstruction.points3D)):  # the order of `sfm_model`
        reconstruction.points3D[key].xyz = adjusted.points[index]
        reconstruction.points3D[key].error = float(means[index])
