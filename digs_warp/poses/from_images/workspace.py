"""The folder in which COLMAP works: its model, and which parts still belong to the images.

    database.db   features and matches, as COLMAP keeps them
    model/        the sparse model, COLMAP's binary files; COLMAP's own viewer opens it
    stages.json   the key, a hash of everything that decides the model, and notes on a finished one
    images/       only for a recording in memory, or the object alone: its left images as PNG files
    masks/        only for images that are partly no scene: black there, as COLMAP wants them

With another key everything begins anew; what was cut off goes on with what is missing.
"""

import hashlib
import json
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.images import write_image
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.sfm_model import Observations, SfmModel
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import invert_rigid, rigid
from digs_warp.poses.from_images.colmap import ImageSet
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.record.disk import check_room, reported, temporary_beside
from digs_warp.record.files import (
    claim,
    copy_file,
    read_json,
    remove,
    remove_folder,
    to_json,
    write_atomically,
)
from digs_warp.record.manifest import is_kept

DATABASE = "database.db"
MODEL = "model"
STAGES = "stages.json"
IMAGES, MASKS = "images", "masks"


def with_image_files(frames: Sequence[Frame], folder: Path) -> list[Frame]:
    """Return the frames with a file for each left image; others are written to ``folder``."""

    def on_disk(frame: Frame) -> Frame:
        if isinstance(frame.layers[Layer.IMAGE], Path) and not frame.alone:
            return frame
        path = folder / f"{frame.name}.png"
        write_image(path, frame.load_image())
        return frame.with_layer(Layer.IMAGE, path)

    return [on_disk(frame) for frame in frames]


def with_scene_masks(frames: Sequence[Frame], names: Sequence[str], folder: Path) -> Path | None:
    """Write a mask of each image, black where it is no scene; return the folder, None: not needed."""
    if not any(frame.has(Layer.UNKNOWN) for frame in frames):
        return None
    for frame, name in zip(frames, names, strict=True):
        unknown, k = frame.load_unknown(), frame.camera.intrinsics
        black = np.zeros((k.height, k.width), bool) if unknown is None else unknown
        write_image(folder / f"{name}.png", np.where(black, 0, 255).astype(np.uint8))
    return folder


def key_of(frames: Sequence[Frame], config: SfmConfig) -> str:
    """Return a hash of what decides the model; reads every image file once."""

    def pixels(frame: Frame) -> str:
        content, unknown = frame.path(Layer.IMAGE).read_bytes(), frame.load_unknown()
        known = b"" if unknown is None else unknown.tobytes()
        return hashlib.sha256(content + known).hexdigest()

    images = [[frame.name, frame.camera.intrinsics, pixels(frame)] for frame in frames]
    others = SfmConfig()  # what is done with the model
    settings = replace(
        config, min_registered=others.min_registered, refine_poses=others.refine_poses
    )
    known: list[Any] = []
    if config.poses != "sfm":
        known = [frame.camera.world_from_cam for frame in frames]
    elif config.readout_time:
        known = [frame.time for frame in frames]
    values = [version("pycolmap"), images, settings, known]
    return hashlib.sha256(to_json(values).encode()).hexdigest()


@dataclass(frozen=True)
class Workspace:
    """The folder, and the key of what belongs into it."""

    folder: Path
    key: str

    @property
    def database(self) -> Path:
        """COLMAP's database."""
        return self.folder / DATABASE

    @property
    def model(self) -> Path:
        """The folder of the chosen model."""
        return self.folder / MODEL

    def prepare(self) -> dict[str, Any] | None:
        """Delete what belongs to other images or settings; return the notes on a finished model.

        COLMAP can crash or take all memory on a damaged model, so only one that is as it was written counts.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        try:
            found = read_json(self.folder / STAGES, "structure from motion, stages")
        except DigsError:  # none yet, or interrupted: everything starts over
            found = {}
        if found.get("key") != self.key:
            for path in self.folder.glob(f"{DATABASE}*"):  # SQLite keeps a log beside the database
                remove(path)
            remove_folder(self.model)
            found = {}
        notes = found.get("notes")
        is_known = isinstance(notes, dict) and type(notes.get("models")) is int
        if is_known and is_complete(self.model) and all(map(is_kept, self.model.iterdir())):
            return notes
        # The database fills up step by step, so it gets its key before it is complete.
        claim(self.database)
        self._write({"key": self.key})
        return None

    def finish_model(self, notes: dict[str, Any]) -> None:
        """Note that the model is complete, with what is worth knowing about how it came about."""
        self._write({"key": self.key, "notes": notes})

    def _write(self, content: dict[str, Any]) -> None:
        write_atomically(self.folder / STAGES, json.dumps(content, indent=2).encode())


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
