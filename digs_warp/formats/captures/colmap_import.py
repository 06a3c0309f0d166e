"""COLMAP workspaces as recordings: photographs with poses and sparse points, through any usual lens.

    images/...                                    the photographs
    masks/NAME.png                                black outside of the object; may be missing
    sparse/0/cameras.bin images.bin points3D.bin  or .txt; also in sparse/, colmap/sparse/0/ or beside

Poses are camera from world, quaternions wxyz, pixel centers at +0.5 as here. COLMAP's unit of length is
arbitrary unless the model was aligned to known places. Its own reader trusts the counts in binary files; this
one believes only the bytes that are there. See https://colmap.github.io/format.html.
"""

import logging
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import CaptureError, require_file
from digs_warp.data.file_names import FileNames, folder_named
from digs_warp.data.index_rules import PINHOLES
from digs_warp.data.point_cloud import PointCloud
from digs_warp.formats.captures.lens import CURVES, Lens, undistorted
from digs_warp.formats.captures.recording import RecordedFrame, Recording, expecting, placed
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import invert_rigid
from digs_warp.record.files import text_lines
from digs_warp.words import counted

logger = logging.getLogger(__name__)

# COLMAP keeps no times. So far apart, photographs are not taken for a film, of which the neighbors of a frame
# tell how the camera moved (`digs_warp/train/shutter.py`).
SECONDS_APART = 1.0

# Where a model may lie in a workspace; "*" is the number of one of several models.
MODEL_PLACES = ("", "sparse", "sparse/*", "colmap", "colmap/sparse/*", "distorted/sparse/*", "*")

# Folders of images; a data set may have been copied with its smaller images only.
IMAGE_FOLDERS = ("images", "input", "rgb", "", "images_2", "images_4", "images_8")

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
BROWN, FISHEYE = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"), ("k1", "k2", "k3", "k4")


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


def is_model(folder: Path) -> bool:
    """Whether a folder holds the files of a model."""
    return any(
        (folder / f"cameras.{end}").is_file() and (folder / f"images.{end}").is_file()
        for end in ("bin", "txt")
    )


def read_model_files(folder: Path) -> ColmapFiles:
    """Read the model in a folder: the binary files, else the text files; points3D may be missing.

    Raises:
        CaptureError: a file is broken, or names a camera model that COLMAP does not have.
    """
    is_binary = (folder / "cameras.bin").is_file() and (folder / "images.bin").is_file()
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
        found = self.data[self.at : end].decode()
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
        yield RegisteredImage(name, camera, np.array(pose))


def _binary_points(path: Path) -> Iterator[tuple[float, ...]]:
    data = _Bytes(path)
    for _ in data.items():
        _, *row, _, length = data.take("Q3d3BdQ")
        data.skip(BYTES_PER_TRACK_ENTRY * length)
        yield tuple(row)


def _lines(path: Path) -> Iterator[str]:
    """Yield all lines but comments; empty ones count: an image without points has one."""
    for line in text_lines(path, "COLMAP file"):
        if not line.startswith("#"):
            yield line.strip()


def _text_cameras(path: Path) -> Iterator[tuple[int, ModelCamera]]:
    for line in filter(None, _lines(path)):
        number, model, width, height, *params = line.split()
        if len(params) != COUNTS.get(model):
            expected = f"{COUNTS[model]} parameters" if model in COUNTS else ", ".join(COUNTS)
            raise CaptureError(
                f"'{path}': camera {number} is {model} with {len(params)} parameters, expected {expected}"
            )
        yield int(number), ModelCamera(model, int(width), int(height), tuple(map(float, params)))


def _text_images(path: Path) -> Iterator[RegisteredImage]:
    # The line after that of an image lists its points: hundreds of megabytes in a large model. Of an image
    # without points it is empty, or missing.
    may_be_points = False
    for line in filter(None, _lines(path)):
        if may_be_points and _are_points(line):
            may_be_points = False
            continue
        words = line.split(maxsplit=9)
        yield RegisteredImage(words[9], int(words[8]), np.array(list(map(float, words[1:8]))))
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


def read_colmap(folder: Path) -> Recording:
    """Read a workspace of COLMAP: its images, the poses and the points of its largest model.

    Raises:
        CaptureError: no model, none of its images, or a camera model that we cannot undistort.
    """
    place, model = _largest_model(folder)
    images = _image_folder(folder, place, model.images)
    rows = sorted(model.images, key=lambda image: image.name)
    files = FileNames(images)
    found = [row for row in rows if files.find(row.name) is not None]
    if len(found) < len(rows):
        lost = next(row.name for row in rows if row not in found)
        logger.warning(
            "recording '%s': %s of the model are not in '%s' and are left out, the first is '%s'",
            *(folder, counted(len(rows) - len(found), "image"), images, lost),
        )
    frames = [_frame(number, row, model, place, files) for number, row in enumerate(found)]
    points = _points(model)
    return Recording(folder, tuple(frames), points=points, poses_in_metres=False, notes=files.notes)


def _largest_model(folder: Path) -> tuple[Path, ColmapFiles]:
    places = {
        place: None
        for pattern in MODEL_PLACES
        for place in (sorted(folder.glob(pattern)) if pattern else [folder])
        if is_model(place)
    }
    if not places:
        raise CaptureError(
            f"recording '{folder}': no COLMAP model (cameras.bin and images.bin, or .txt) in it nor in "
            "sparse/0; is this the right --from? Name the folder that holds images and sparse"
        )
    models = [(place, read_model_files(place)) for place in places]
    place, model = max(models, key=lambda pair: len(pair[1].images))
    if not model.images:
        raise CaptureError(f"'{place}': the COLMAP model has no images; expected at least one")
    if len(models) > 1:
        logger.warning(
            "recording '%s': %d models; reading the largest, '%s', with %s",
            *(folder, len(models), place, counted(len(model.images), "image")),
        )
    return place, model


def _image_folder(folder: Path, place: Path, images: Sequence[RegisteredImage]) -> Path:
    """Return the folder to which the names of the images are relative."""
    inside = [each for each in (place, *place.parents) if each.is_relative_to(folder)]
    tried = [folder_named(each, name) for each in inside[::-1] for name in IMAGE_FOLDERS]
    # A model beside the folder of images may have been named itself.
    tried += [folder.parent / "images", folder.parent.parent / "images"]
    for candidate in tried:
        files = FileNames(candidate)
        if any(files.find(image.name) is not None for image in images):
            return candidate
    raise CaptureError(
        f"recording '{folder}': none of the model's images, such as '{images[0].name}', is in "
        f"'{folder / 'images'}'; put the folder of images there"
    )


def _frame(
    number: int,
    row: RegisteredImage,
    model: ColmapFiles,
    place: Path,
    files: FileNames,
) -> RecordedFrame:
    where = f"'{place}', image '{row.name}'"
    if row.camera_id not in model.cameras:
        raise CaptureError(f"{where}: has camera {row.camera_id}, which the model does not have")
    if ".." in Path(row.name).parts or Path(row.name).is_absolute():
        raise CaptureError(f"{where}: leaves the folder of images; paths must stay inside")
    k, lens = pinhole_and_lens(model.cameras[row.camera_id], where)
    cam_from_world = placed(np.roll(row.pose[:4], -1), row.pose[4:])
    return RecordedFrame(
        image=files.require(row.name, where),
        intrinsics=k,
        time=SECONDS_APART * number,
        world_from_cam=None if cam_from_world is None else invert_rigid(cam_from_world),
        view=undistorted(k, lens),
    )


def pinhole_and_lens(camera: ModelCamera, where: str) -> tuple[Intrinsics, Lens | None]:
    """Return a camera of COLMAP as a pinhole camera and what bends its light.

    Raises:
        CaptureError: a model without a formula here, or parameters that are no camera.
    """
    names = PARAMETERS[camera.model]
    if isinstance(names, int):
        known = ", ".join(name for name, each in PARAMETERS.items() if isinstance(each, str))
        raise CaptureError(
            f"{where}: camera model {camera.model}, expected one of {known}; {PINHOLES}"
        )
    values = dict(zip(names.split(), camera.params, strict=True))
    fx = values.get("fx", values.get("s", 0.0))
    k = Intrinsics(
        camera.width, camera.height, fx, values.get("fy", fx), values["cx"], values["cy"]
    )
    if not np.isfinite(camera.params).all():
        raise CaptureError(f"{where}: camera parameters {camera.params}, expected finite numbers")
    if "FISHEYE" in camera.model:
        return k, Lens(tuple(values.get(name, 0.0) for name in FISHEYE), is_fisheye=True)
    curve = next((name for name in CURVES if name in camera.model), "")
    if curve:
        given = [name for name in values if name not in ("s", "fx", "fy", "cx", "cy")]
        return k, Lens(tuple(values[name] for name in given), curve=curve)
    return k, Lens.brown(*(values.get(name, 0.0) for name in BROWN))


def _points(model: ColmapFiles) -> Callable[[np.ndarray], PointCloud] | None:
    sound = np.isfinite(model.points).all(axis=1)
    if not sound.any():
        return None
    colors = np.clip(model.rgb[sound] / 255, 0, 1)
    return lambda offset: PointCloud(model.points[sound] - offset, colors)
