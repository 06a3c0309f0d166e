"""Errors of cameras apart from the similarity that structure from motion leaves open."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.sfm_model import SfmModel
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import laid_over, turn_degrees
from digs_warp.poses.from_images.similarity import check_spread


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """Errors of the registered cameras after the best similarity alignment of their centers.

    Attributes:
        centers_m: distance of each center to the true one [m], shape (n,).
        rotations_deg: angle of each rotation to the true one [degree], shape (n,).
        sfm_per_metre: the scale that the true poses tell.
    """

    centers_m: np.ndarray
    rotations_deg: np.ndarray
    sfm_per_metre: float


def pose_errors(model: SfmModel, frames: Sequence[Frame]) -> PoseErrors:
    """Compare the model's cameras with those of the frames of the same names, taken as true.

    Raises:
        DigsError: fewer than three cameras, or cameras on one line.
    """
    return camera_errors(dict(zip(model.names, model.cameras, strict=True)), frames)


def camera_errors(cameras: Mapping[str, Camera], frames: Sequence[Frame]) -> PoseErrors:
    """Compare cameras, by the names of their frames, with those of ``frames``, taken as true.

    Raises:
        DigsError: fewer than three cameras, or cameras on one line.
    """
    true = {frame.name: frame.camera for frame in frames}
    truths = [true[name] for name in cameras]
    found = np.array([camera.center_world for camera in cameras.values()])
    expected = np.array([camera.center_world for camera in truths])
    check_spread(found, expected)
    rotation = laid_over(found, expected)[:3, :3]
    a, b = found - found.mean(axis=0), expected - expected.mean(axis=0)
    # Umeyama, IEEE PAMI 1991, eq. 42.
    scale = float((b * (a @ rotation.T)).sum() / (a**2).sum())
    turned = np.array([rotation @ c.world_from_cam[:3, :3] for c in cameras.values()])
    rotations = np.array([c.world_from_cam[:3, :3] for c in truths])
    return PoseErrors(
        centers_m=np.linalg.norm(scale * a @ rotation.T - b, axis=1),
        rotations_deg=turn_degrees(turned, rotations),
        sfm_per_metre=1.0 / scale,
    )
