"""COLMAP's reconstruction: as an `SfmModel` with names, axes and indices of this project, and as files."""

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.sfm_model import Observations, SfmModel
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import invert_rigid, rigid
from digs_warp.poses.from_images.colmap import ImageSet
from digs_warp.record.disk import check_room, reported, temporary_beside
from digs_warp.record.files import copy_file, remove_folder

FILES = ("cameras.bin", "frames.bin", "images.bin", "points3D.bin", "rigs.bin")

# Bytes in COLMAP's binary files: at most in all headers, of a point, of a place in its track, of a feature.
_HEADERS, _POINT, _IN_TRACK, _FEATURE = 1 << 16, 51, 8, 24


def write_model(model: Any, folder: Path) -> None:
    """Write a `pycolmap.Reconstruction` into a folder, in place of an older model.

    COLMAP reports success for truncated files: the room is checked before.

    Raises:
        DigsError: the disk is full.
    """
    unfinished = temporary_beside(folder)
    features = sum(len(image.points2D) for image in model.images.values())
    size = _HEADERS + _POINT * model.num_points3D() + _FEATURE * features
    check_room(unfinished, size + _IN_TRACK * model.compute_num_observations())
    try:
        with reported(folder):
            unfinished.mkdir(parents=True, exist_ok=True)
        model.write(unfinished)
        remove_folder(folder)
        for name in FILES:
            copy_file(unfinished / name, folder / name)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def is_complete(folder: Path) -> bool:
    """Whether all files of a model are there."""
    return all((folder / name).is_file() for name in FILES)


def sfm_model(reconstruction: Any, frames: Sequence[Frame], images: ImageSet) -> SfmModel:
    """Return the model with its frames in the order of the recording.

    Args:
        reconstruction: a pycolmap.Reconstruction of these images.
        frames: all frames of the recording.
        images: their names in COLMAP.
    """
    posed = {image.name: image for image in reconstruction.images.values() if image.has_pose}
    named = zip(frames, images.names, strict=True)
    kept = [(frame, posed[name]) for frame, name in named if name in posed]
    point_ids = sorted(reconstruction.points3D)
    points = [reconstruction.points3D[key] for key in point_ids]
    return SfmModel(
        names=tuple(frame.name for frame, _ in kept),
        cameras=tuple(_camera(frame, image) for frame, image in kept),
        points=PointCloud(
            np.array([point.xyz for point in points]).reshape(-1, 3),
            np.array([point.color for point in points]).reshape(-1, 3) / 255.0,
        ),
        observations=_observations([image for _, image in kept], point_ids),
        reprojection_errors=np.array([point.error for point in points], dtype=np.float32),
    )


def _camera(frame: Frame, image: Any) -> Camera:
    pose = image.cam_from_world()
    world_from_cam = invert_rigid(rigid(pose.rotation.matrix(), pose.translation))
    k = frame.camera.intrinsics
    fx, fy, cx, cy = image.camera.params.tolist()
    return Camera(Intrinsics(k.width, k.height, fx, fy, cx, cy), world_from_cam)


def _observations(images: Sequence[Any], point_ids: Sequence[int]) -> Observations:
    """All measurements, camera by camera."""
    index = {key: number for number, key in enumerate(point_ids)}
    cameras, points, px = [], [], []
    for number, image in enumerate(images):
        for measured in image.get_observation_points2D():
            cameras.append(number)
            points.append(index[measured.point3D_id])
            px.append(measured.xy)
    return Observations(np.array(cameras), np.array(points), np.array(px).reshape(-1, 2))
