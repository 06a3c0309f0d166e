"""COLMAP workspaces as recordings: photographs with poses and sparse points, through any usual lens.

docs/recordings.md has the layout. Poses are camera from world, quaternions wxyz, pixel centers at +0.5 as
here. COLMAP's unit of length is arbitrary unless the model was aligned to known places.
"""

import logging
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.data.file_names import FileNames, folder_named
from digs_warp.data.index_rules import PINHOLES
from digs_warp.data.point_cloud import PointCloud
from digs_warp.formats.captures.colmap_files import (
    PARAMETERS,
    ColmapFiles,
    ModelCamera,
    RegisteredImage,
    is_model,
    read_model_files,
)
from digs_warp.formats.captures.lens import CURVES, Lens, undistorted
from digs_warp.formats.captures.recording import RecordedFrame, Recording, placed
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import invert_rigid
from digs_warp.words import counted

logger = logging.getLogger(__name__)

# COLMAP keeps no times. So far apart, photographs are no film, whose neighbors tell how the camera moved.
SECONDS_APART = 1.0

# Where a model may lie in a workspace; "*" is the number of one of several models.
MODEL_PLACES = ("", "sparse", "sparse/*", "colmap", "colmap/sparse/*", "distorted/sparse/*", "*")

# Folders of images; a data set may have been copied with its smaller images only.
IMAGE_FOLDERS = ("images", "input", "rgb", "", "images_2", "images_4", "images_8")

BROWN, FISHEYE = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"), ("k1", "k2", "k3", "k4")


def read_colmap(folder: Path) -> Recording:
    """Read a workspace of COLMAP: its images, the poses and the points of its largest model."""
    place, model = _largest_model(folder)
    images = _image_folder(folder, place, model.images)
    rows = sorted(model.images, key=_in_order)
    files = FileNames(images)
    found = [row for row in rows if files.find(row.name) is not None]
    if len(found) < len(rows):
        lost = next(row.name for row in rows if row not in found)
        logger.warning(
            "recording '%s': %s of the model are not in '%s' and are left out, the first is '%s'",
            *(folder, counted(len(rows) - len(found), "image"), images, lost),
        )
    frames = [_frame(number, row, model, place, files) for number, row in enumerate(found)]
    if is_model(place, ("txt",)) and is_model(place, ("bin",)):
        files.notes["the binary model is read, not the text beside it"] = 1
    points = _points(model)
    return Recording(folder, tuple(frames), points=points, poses_in_metres=False, notes=files.notes)


def _in_order(image: RegisteredImage) -> list[str | int]:
    """Return what orders images by name as people do: 9.png before 10.png."""
    parts = re.split(r"(\d+)", image.name)
    return [int(part) if part.isdecimal() else part for part in parts]


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
    """Return a camera of COLMAP as a pinhole camera and what bends its light."""
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
