"""The files of a COLMAP model, binary or text, as others wrote them; see https://colmap.github.io/format.html.

COLMAP's own reader trusts the counts in binary files; this one believes only the bytes that are there.
"""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from digs_warp.checks import CaptureError, require_file
from digs_warp.formats.captures.recording import expecting
from digs_warp.record.files import text_lines

# COLMAP's camera models in the order of their numbers, and how their parameters follow each other: s is a
# focal length for both axes; of those that nobody undistorts here, how many there are.
PARAMETERS: dict[str, str | int] = {
    "SIMPLE_PINHOLE": "s cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "s cx cy k1",
    "RADIAL": "s cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "OPENCV_FISHEYE": "fx fy cx cy k1 k2 k3 k4",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6",
    "FOV": "fx fy cx cy omega",
    "SIMPLE_RADIAL_FISHEYE": "s cx cy k1",
    "RADIAL_FISHEYE": "s cx cy k1 k2",
    "THIN_PRISM_FISHEYE": 12,
    "RAD_TAN_THIN_PRISM_FISHEYE": 16,
    "SIMPLE_DIVISION": "s cx cy k",
    "DIVISION": "fx fy cx cy k",
    "SIMPLE_FISHEYE": "s cx cy",
    "FISHEYE": "fx fy cx cy",
    "EUCM": "fx fy cx cy alpha beta",
    "EQUIRECTANGULAR": 2,
}
COUNTS = {
    name: each if isinstance(each, int) else len(each.split()) for name, each in PARAMETERS.items()
}


BYTES_PER_POINT_2D, BYTES_PER_TRACK_ENTRY = 24, 8


@dataclass(frozen=True)
class ModelCamera:
    """A camera as COLMAP has it: the name of its model, its image size, its parameters in COLMAP's order."""

    model: str
    width: int
    height: int
    params: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class RegisteredImage:
    """An image with a pose: camera from world, quaternion wxyz and translation, 7 numbers."""

    name: str
    camera_id: int
    pose: np.ndarray


@dataclass(frozen=True, eq=False)
class ColmapFiles:
    """What the files of a model say.

    Attributes:
        cameras: by their number.
        images: in the order of the file.
        points: positions in the model's unit, shape (n, 3).
        rgb: their colors, 0 to 255, shape (n, 3).
    """

    cameras: dict[int, ModelCamera]
    images: list[RegisteredImage]
    points: np.ndarray
    rgb: np.ndarray


def is_model(folder: Path, ends: Sequence[str] = ("bin", "txt")) -> bool:
    """Whether a folder holds the files of a model."""
    return any(
        (folder / f"cameras.{end}").is_file() and (folder / f"images.{end}").is_file()
        for end in ends
    )


def read_model_files(folder: Path) -> ColmapFiles:
    """Read the model in a folder: the binary files, else the text files; points3D may be missing."""
    is_binary = is_model(folder, ("bin",))
    end = "bin" if is_binary else "txt"
    cameras = folder / f"cameras.{end}"
    images = folder / f"images.{end}"
    points = folder / f"points3D.{end}"
    table = np.zeros((0, 6))
    if points.is_file() and points.stat().st_size > 0:
        with expecting(f"'{points}'", "points of a COLMAP model"):
            rows = list(_binary_points(points) if is_binary else _text_points(points))
            table = np.array(rows, dtype=np.float64).reshape(-1, 6)
    with expecting(f"'{cameras}'", "cameras of a COLMAP model"):
        found = dict(_binary_cameras(cameras) if is_binary else _text_cameras(cameras))
    with expecting(f"'{images}'", "images of a COLMAP model"):
        posed = list(_binary_images(images) if is_binary else _text_images(images))
    return ColmapFiles(found, posed, table[:, :3], table[:, 3:])


class _Bytes:
    """A binary file, read from its start to its end."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.data = require_file(path, "COLMAP file").read_bytes()
        self.at = 0

    def take(self, form: str) -> tuple[Any, ...]:
        """Return the next values, little-endian."""
        layout = struct.Struct(f"<{form}")
        start = self.skip(layout.size)
        return layout.unpack_from(self.data, start)

    def skip(self, size: int) -> int:
        """Go on by ``size`` bytes, and return where they begin."""
        start = self.at
        if start + size > len(self.data):
            raise CaptureError(
                f"'{self.path}': {len(self.data)} bytes, but more are announced; truncated or damaged, copy "
                "or export it again"
            )
        self.at += size
        return start

    def text(self) -> str:
        """Return the next text, which ends with a zero byte."""
        end = self.data.index(0, self.at)
        found = self.data[self.at : end].decode(errors="surrogateescape")
        self.at = end + 1
        return found

    def items(self) -> Iterator[int]:
        """Count the items that the next number announces."""
        yield from range(self.take("Q")[0])


def _binary_cameras(path: Path) -> Iterator[tuple[int, ModelCamera]]:
    data, names = _Bytes(path), list(COUNTS)
    for _ in data.items():
        number, model, width, height = data.take("IiQQ")
        if not 0 <= model < len(names):
            raise CaptureError(
                f"'{path}': camera {number} has model {model}, expected 0 to {len(names) - 1}"
            )
        params = data.take(f"{COUNTS[names[model]]}d")
        yield number, ModelCamera(names[model], width, height, params)


def _binary_images(path: Path) -> Iterator[RegisteredImage]:
    data = _Bytes(path)
    for _ in data.items():
        _, *pose, camera = data.take("I7dI")
        name = data.text()
        data.skip(BYTES_PER_POINT_2D * data.take("Q")[0])
        yield RegisteredImage(_below(name), camera, np.array(pose))


def _below(name: str) -> str:
    """Return a name of an image as a path that stays below their folder."""
    return "/".join(part for part in PurePosixPath(name).parts if part not in ("/", ".."))


def _binary_points(path: Path) -> Iterator[tuple[float, ...]]:
    data = _Bytes(path)
    for _ in data.items():
        _, *row, _, length = data.take("Q3d3BdQ")
        data.skip(BYTES_PER_TRACK_ENTRY * length)
        yield tuple(row)


def _lines(path: Path) -> Iterator[str]:
    """Yield all lines but comments; empty ones count: an image without points has one."""
    for line in text_lines(path, "COLMAP file"):
        if not (line := line.strip()).startswith("#"):
            yield line


def _text_cameras(path: Path) -> Iterator[tuple[int, ModelCamera]]:
    for line in filter(None, _lines(path)):
        number, model, width, height, *params = line.split()
        if len(params) != COUNTS.get(model):
            expected = f"{COUNTS[model]} parameters" if model in COUNTS else ", ".join(COUNTS)
            raise CaptureError(
                f"'{path}': camera {number} is {model} with {len(params)} parameters, expected {expected}"
            )
        size = int(float(width)), int(float(height))
        yield int(number), ModelCamera(model, *size, tuple(map(float, params)))


def _text_images(path: Path) -> Iterator[RegisteredImage]:
    # The line after that of an image lists its points: hundreds of megabytes in a large model. Of an image
    # without points it is empty, or missing.
    may_be_points = False
    for line in filter(None, _lines(path)):
        if may_be_points and _are_points(line):
            may_be_points = False
            continue
        words = line.split(maxsplit=9)
        pose = np.array([float(word) for word in words[1:8]])
        yield RegisteredImage(_below(words[9]), int(words[8]), pose)
        may_be_points = True


def _are_points(line: str) -> bool:
    """Whether a line has points, x, y and the number of a 3D point each; only its ends are looked at."""
    words = line.split(maxsplit=12)
    ends = (*words[:12], words[-1].rsplit(maxsplit=1)[-1])
    return (len(words) > 12 or len(words) % 3 == 0) and all(map(_is_number, ends))


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _text_points(path: Path) -> Iterator[tuple[float, ...]]:
    for line in filter(None, _lines(path)):
        yield tuple(map(float, line.split(maxsplit=7)[1:7]))
