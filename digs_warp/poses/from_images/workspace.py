"""The folder in which COLMAP works: which of its parts still belong to these images and settings.

    database.db   features and matches, as COLMAP keeps them
    model/        the sparse model, COLMAP's binary files; COLMAP's own viewer opens it
    stages.json   the key of each stage: a hash of everything that decides its result
    images/       only for a recording in memory, or the object alone: its left images as PNG files
    masks/        only for images that are partly no scene: black there, as COLMAP wants them

A stage whose key is unchanged is not done again; one that was cut off goes on with what is missing.
"""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.images import write_image
from digs_warp.data.layers import Layer
from digs_warp.poses.from_images.colmap import LOG_BYTES
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.from_images.model import is_complete
from digs_warp.record.disk import check_room
from digs_warp.record.files import (
    claim,
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


@dataclass(frozen=True)
class StageKeys:
    """A hash per stage; each covers the stages before it."""

    features: str
    matches: str
    model: str


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


def stage_keys(frames: Sequence[Frame], config: SfmConfig) -> StageKeys:
    """Return what decides the result of each stage, as hashes; reads every image file once."""

    def pixels(frame: Frame) -> str:
        content, unknown = frame.path(Layer.IMAGE).read_bytes(), frame.load_unknown()
        known = b"" if unknown is None else unknown.tobytes()
        return hashlib.sha256(content + known).hexdigest()

    images = [[frame.name, pixels(frame)] for frame in frames]
    cameras = [frame.camera.intrinsics for frame in frames]
    features = _key(
        version("pycolmap"), images, cameras,
        config.feature_size, config.features, config.double_size,
    )  # fmt: skip
    matches = _key(
        features, config.pairing, config.overlap, config.loop_images, config.sfm_seed,
    )  # fmt: skip
    poses: list[Any] = [config.poses]
    if config.poses == "sfm":
        poses += [config.refine_focal, config.min_registered]
        if config.readout_time:
            poses += [config.readout_time, [frame.time for frame in frames]]
    else:
        poses += [frame.camera.world_from_cam for frame in frames]
    return StageKeys(features, matches, _key(matches, poses))


def _key(*values: Any) -> str:
    return hashlib.sha256(to_json(list(values)).encode()).hexdigest()


@dataclass(frozen=True)
class Workspace:
    """The folder, and the keys that its parts should have."""

    folder: Path
    keys: StageKeys

    @property
    def database(self) -> Path:
        """COLMAP's database."""
        return self.folder / DATABASE

    @property
    def model(self) -> Path:
        """The folder of the chosen model."""
        return self.folder / MODEL

    def prepare(self) -> None:
        """Delete what belongs to other images or settings; keep the rest."""
        self.folder.mkdir(parents=True, exist_ok=True)
        found = self._read()
        if found.get("features") != self.keys.features:
            for path in self.folder.glob(f"{DATABASE}*"):  # SQLite keeps a log beside the database
                remove(path)
        elif found.get("matches") != self.keys.matches and self.database.is_file():
            self._forget_matches()
        if found.get("model") != self.keys.model:
            remove_folder(self.model)
            found = {}
        # The database fills up step by step, so its stages are named before they are complete.
        claim(self.database)
        self._write(found | {"features": self.keys.features, "matches": self.keys.matches})

    def finished_model(self) -> dict[str, Any] | None:
        """Return what was noted about the model when it was finished, or None: there is none yet.

        COLMAP can crash or take all memory on a damaged model, so only one that is as it was written counts.
        """
        found = self._read()
        notes = found.get("notes")
        is_whole = is_complete(self.model) and all(map(is_kept, self.model.iterdir()))
        is_known = isinstance(notes, dict) and type(notes.get("models")) is int
        done = found.get("model") == self.keys.model and is_whole and is_known
        return notes if done else None

    def finish_model(self, notes: dict[str, Any]) -> None:
        """Note that the model is complete, with what is worth knowing about how it came about."""
        self._write(self._read() | {"model": self.keys.model, "notes": notes})

    def _forget_matches(self) -> None:
        from digs_warp.device.libraries import import_pycolmap

        check_room(self.database, LOG_BYTES)
        with import_pycolmap().Database.open(self.database) as database:
            database.clear_matches()
            database.clear_two_view_geometries()

    def _read(self) -> dict[str, Any]:
        try:
            return read_json(self.folder / STAGES, "structure from motion, stages")
        except DigsError:  # none yet, or interrupted: everything starts over
            return {}

    def _write(self, content: dict[str, Any]) -> None:
        write_atomically(self.folder / STAGES, json.dumps(content, indent=2).encode())
