"""Reads a capture folder: images, depths, masks and poses of one recording, on disk.

The index is nerfstudio's ``transforms.json``, so other tools read the folder, too; our keys lie beside
theirs. Pixels are loaded when asked for. The layout is described in docs/capture-format.md;
`digs_warp.data.capture_writer` writes it.
"""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.camera import Camera, Intrinsics
from digs_warp.checks import CaptureError, check_positive, require_folder
from digs_warp.data.images import read_image
from digs_warp.geometry import OPENCV_FROM_OPENGL
from digs_warp.record.files import read_json

INDEX_NAME = "transforms.json"
OF_A_CAMERA = "'digs-warp convert FOLDER --from FORM --out CAPTURE' makes one of a real recording."

# Key in transforms.json -> what it is called in messages.
_LABELS = {
    "file_path": "image",
    "right_file_path": "right image",
    "depth_file_path": "depth",
    "depth_true_file_path": "true depth",
    "mask_path": "mask",
    "cause_file_path": "cause",
    "confidence_file_path": "confidence",
    "normals_file_path": "normals",
}


@dataclass(frozen=True)
class Rig:
    """The stereo rig: the right camera sits ``baseline`` metres along the left camera's x axis."""

    baseline: float


@dataclass(frozen=True, eq=False)
class Frame:
    """One moment of a recording: the left camera, the time [s], and where its files lie.

    ``files`` maps the keys of transforms.json to paths; only ``file_path`` is always there.
    """

    name: str
    camera: Camera
    time: float
    files: dict[str, Path]

    def load_image(self) -> np.ndarray:
        """Return the left image, sRGB, shape (height, width, 3), uint8."""
        return self._load_rgb("file_path")

    def load_right_image(self) -> np.ndarray:
        """Return the right image, sRGB, shape (height, width, 3), uint8."""
        return self._load_rgb("right_file_path")

    def load_depth(self) -> np.ndarray:
        """Return the sensed planar depth [m], shape (height, width), float32, NaN where unknown."""
        return self._load_depth("depth_file_path")

    def load_depth_true(self) -> np.ndarray:
        """Return the true planar depth [m], shape (height, width), float32, NaN where unknown."""
        return self._load_depth("depth_true_file_path")

    def load_mask(self) -> np.ndarray:
        """Return the object mask, 0..255, shape (height, width), uint8."""
        return self._load_grey("mask_path")

    def load_cause(self) -> np.ndarray:
        """Return why each depth pixel is missing or wrong, shape (height, width), uint8; 0: it is neither.

        The capture's ``cause_labels`` (in its metadata) names the values.
        """
        return self._load_grey("cause_file_path")

    def load_confidence(self) -> np.ndarray:
        """Return the sensor's trust in its depth, 0 to 1, shape (height, width), float32."""
        return self._load_grey("confidence_file_path").astype(np.float32) / np.float32(255)

    def load_normals(self) -> np.ndarray:
        """Return true unit normals in the world, toward the viewer, (height, width, 3), float32."""
        pixels = self._load("normals_file_path")
        if pixels.dtype != np.float32 or pixels.shape[2] != 3:
            raise CaptureError(
                f"normals '{self.files['normals_file_path']}': {pixels.shape[2]} channels of "
                f"{pixels.dtype}, expected a float EXR with x, y, z"
            )
        return pixels

    def has(self, key: str) -> bool:
        """Whether the index names a file for ``key`` (such as "mask_path")."""
        return key in self.files

    def _load_rgb(self, key: str) -> np.ndarray:
        pixels = self._load(key)
        if pixels.dtype != np.uint8 or pixels.shape[2] < 3:
            raise CaptureError(
                f"image '{self.files[key]}': {pixels.shape[2]} channels of {pixels.dtype}, "
                "expected 3 of uint8; convert it to an 8-bit RGB PNG"
            )
        return np.ascontiguousarray(pixels[..., :3])

    def _load_grey(self, key: str) -> np.ndarray:
        pixels = self._load(key)
        if pixels.dtype != np.uint8:
            raise CaptureError(f"{_LABELS[key]} '{self.files[key]}': expected 8 bits per pixel")
        return pixels[..., 0]

    def _load_depth(self, key: str) -> np.ndarray:
        pixels = self._load(key)
        if pixels.dtype == np.uint16:  # 16-bit PNG: millimetres, 0 where unknown
            depth = pixels[..., 0].astype(np.float32) / np.float32(1000)
        elif pixels.dtype == np.float32:
            depth = pixels[..., 0].copy()
        else:
            raise CaptureError(
                f"depth '{self.files[key]}': {pixels.dtype}, expected a float EXR in metres "
                "or a 16-bit PNG in millimetres"
            )
        # Sensors mark missing depth as 0, negative, NaN or infinite; in memory it is NaN.
        depth[~(np.isfinite(depth) & (depth > 0))] = np.nan
        return depth

    def _load(self, key: str) -> np.ndarray:
        if key not in self.files:
            raise CaptureError(f"frame '{self.name}': the capture has no '{key}'")
        path = self.files[key]
        pixels = read_image(path, what=_LABELS[key])
        k = self.camera.intrinsics
        if pixels.shape[:2] != (k.height, k.width):
            raise CaptureError(
                f"'{path}': {pixels.shape[1]}x{pixels.shape[0]} pixels, expected "
                f"{k.width}x{k.height} as {INDEX_NAME} says; export the file again or correct w and h"
            )
        return pixels


@dataclass(frozen=True, eq=False)
class Capture:
    """A recording: its frames in order of time, the rig (if stereo), and what the folder tells of itself."""

    folder: Path
    frames: tuple[Frame, ...]
    rig: Rig | None
    metadata: dict[str, Any]

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def knows_poses(self) -> bool:
        """Whether the poses mean anything: a recording without them has the identity in every frame."""
        return bool(self.metadata.get("poses_known", True))

    @property
    def readout_time(self) -> float:
        """How long the camera takes from the first row of an image to the last [s]; 0 if it does not say.

        Raises:
            CaptureError: the index says something that is no time.
        """
        found = self.metadata.get("readout_time", 0.0)
        if not isinstance(found, int | float) or not 0 <= found < np.inf:
            raise CaptureError(
                f"capture '{self.folder}', digs_warp in {INDEX_NAME}: readout_time is {found!r}, expected "
                "seconds, 0 for a camera that takes all rows at once"
            )
        return float(found)

    def split(self, test_every: int = 8) -> tuple[list[Frame], list[Frame]]:
        """Return (training, test) frames: every ``test_every``-th, from the first on, is held out."""
        test = [frame for i, frame in enumerate(self.frames) if i % test_every == 0]
        train = [frame for i, frame in enumerate(self.frames) if i % test_every != 0]
        return train, test


def read_capture(folder: Path) -> Capture:
    """Open a capture folder; pixels stay on disk until a frame loads them.

    Raises:
        CaptureError: no or broken index, no frames, missing files, unusable poses or intrinsics, or a
            path that leaves the folder. The message names the frame and the key.
    """
    folder = require_folder(folder, "capture", f"'digs-warp simulate' writes one. {OF_A_CAMERA}")
    if not (folder / INDEX_NAME).is_file():
        raise CaptureError(
            f"capture '{folder}': no {INDEX_NAME} in it. Was 'digs-warp simulate' interrupted? "
            f"Run it again with --resume. {OF_A_CAMERA}"
        )
    index = read_json(folder / INDEX_NAME, "capture index")
    entries = index.get("frames")
    if not isinstance(entries, list) or not entries:
        raise CaptureError(f"capture '{folder}': {INDEX_NAME} lists no frames")
    ours = index.get("digs_warp", {})
    rig = _read_rig(folder, ours)
    frames = tuple(_read_frame(folder, index, entry, i) for i, entry in enumerate(entries))
    return Capture(folder, frames, rig, metadata=ours)


def _read_rig(folder: Path, ours: Any) -> Rig | None:
    try:
        return (
            Rig(check_positive("baseline", float(ours["rig"]["baseline"])))
            if "rig" in ours
            else None
        )
    except (KeyError, TypeError, ValueError) as error:
        raise CaptureError(
            f"capture '{folder}', digs_warp in {INDEX_NAME}: unusable rig ({error!r}), expected "
            '{"rig": {"baseline": metres above 0}} or no rig'
        ) from error


def _read_frame(folder: Path, index: dict[str, Any], entry: dict[str, Any], number: int) -> Frame:
    where = f"capture '{folder}', frame {number}"
    try:
        # nerfstudio lets a frame override the shared intrinsics.
        value = partial(_lookup, entry, index)
        intrinsics = Intrinsics(
            int(value("w")),
            int(value("h")),
            *(float(value(key)) for key in ("fl_x", "fl_y", "cx", "cy")),
        )
        world_from_cam = np.array(entry["transform_matrix"], dtype=np.float64) @ OPENCV_FROM_OPENGL
        camera = Camera(intrinsics, world_from_cam)
        time = float(entry.get("time", number))
        files = {
            key: _inside(folder, entry[key], f"{where}, {key}") for key in _LABELS if key in entry
        }
    except KeyError as error:
        raise CaptureError(f"{where}: {INDEX_NAME} has no {error}") from None
    except (TypeError, ValueError) as error:
        raise CaptureError(f"{where}: {error}") from error
    if "file_path" not in files:
        raise CaptureError(f"{where}: {INDEX_NAME} has no 'file_path'")
    return Frame(files["file_path"].stem, camera, time, files)


def _lookup(entry: dict[str, Any], index: dict[str, Any], key: str) -> Any:
    return entry[key] if key in entry else index[key]


def _inside(folder: Path, relative: str, where: str) -> Path:
    """Return the path of a file of the capture; refuse one that leaves the folder."""
    path = folder / relative
    if not path.resolve().is_relative_to(folder.resolve()):
        raise CaptureError(
            f"{where}: '{relative}' leaves the capture folder; paths must stay inside"
        )
    if not path.is_file():
        raise CaptureError(f"{where}: '{relative}' does not exist")
    return path
