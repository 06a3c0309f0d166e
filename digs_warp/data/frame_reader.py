"""Reads a frame's entry in the index of a capture."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from digs_warp.checks import CaptureError, DigsError
from digs_warp.data.file_names import FileNames
from digs_warp.data.frame import Frame
from digs_warp.data.index_rules import (
    INDEX_NAME,
    UNDISTORT,
    require_metres,
    require_pinhole,
)
from digs_warp.data.layers import Layer
from digs_warp.data.objects import ObjectView
from digs_warp.data.rig import Exposure
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL
from digs_warp.record.fields import ABOVE_ZERO, Fields, shown
from digs_warp.record.typed import from_json


def read_frame(folder: Path, index: dict[str, Any], entry: Any, number: int) -> Frame:
    """Return a frame of a capture folder; its pixels stay on disk.

    Args:
        folder: of the capture.
        index: the content of its transforms.json.
        entry: the frame's part of it.
        number: of the frame, for messages.

    Raises:
        CaptureError: missing files, unusable poses or intrinsics, or a path that leaves the folder.
    """
    where = f"capture '{folder}', frame {number}"
    own = Fields.of(entry, where, CaptureError)
    require_pinhole(index, entry, f"{where} in {INDEX_NAME}")
    require_metres(index, entry, f"{where} in {INDEX_NAME}")
    camera = _read_camera(own, index)
    files = {
        layer: _inside(folder, own.text(layer.value), f"{where}, {layer.value}")
        for layer in Layer
        if layer.value in own
    }
    if Layer.IMAGE not in files:
        raise CaptureError(f"{where}: {INDEX_NAME} has no '{Layer.IMAGE.value}'")
    time = own.number("time", default=float(number))
    objects = tuple(
        from_json(ObjectView, each.values, each.where, error=CaptureError)
        for each in own.sections("objects", [])
    )
    gain = _read_color_gain(own)
    exposure = from_json(Exposure, own.values, where, error=CaptureError)
    name = files[Layer.IMAGE].stem
    ours = "digs_warp" in index
    return Frame(name, camera, time, files, gain, objects, exposure=exposure, has_plain_masks=ours)


def _read_color_gain(own: Fields) -> tuple[float, float, float] | None:
    if "color_gain" not in own:
        return None
    red, green, blue = gain = own.array("color_gain", (3,)).tolist()
    if min(gain) <= 0:
        raise CaptureError(f"{own.where}: color_gain is {shown(gain)}, expected numbers above 0")
    return red, green, blue


def _read_camera(own: Fields, index: dict[str, Any]) -> Camera:
    """Return the camera of a frame; nerfstudio lets it override the shared intrinsics."""
    k = replace(own, shared=index)
    size = k.whole("w", 1), k.whole("h", 1)
    fx, fy = (k.number(name, ABOVE_ZERO, what="pixels above 0") for name in ("fl_x", "fl_y"))
    cx, cy = (
        k.number(
            name,
            -side,
            2 * side,
            what=f"pixels from {-side} to {2 * side}, for images of {side}",
        )
        for name, side in zip(("cx", "cy"), size, strict=True)
    )
    intrinsics = Intrinsics(*size, fx, fy, cx, cy)
    try:
        return Camera(intrinsics, own.array("transform_matrix", (4, 4)) @ OPENCV_FROM_OPENGL)
    except DigsError as error:
        raise CaptureError(f"{own.where}: {error}; {UNDISTORT} leaves lost frames out") from error


def _inside(folder: Path, relative: str, where: str) -> Path:
    """Return the path of a file of the capture; reject one outside the folder."""
    path = path_inside(folder, relative, where)
    if path.is_file():
        return path
    return path_inside(folder, str(FileNames(folder).require(relative, where)), where)


def path_inside(folder: Path, relative: str, where: str) -> Path:
    """Return a path below ``folder`` that the system allows; there may be no such file.

    Raises:
        CaptureError: it leaves the folder, or no file can have that name.
    """
    path = folder / relative
    try:
        is_inside = path.resolve().is_relative_to(folder.resolve())
        path.is_file()
    except (OSError, RuntimeError) as error:  # a name that is too long; links that form a loop
        raise CaptureError(f"{where}: '{shown(relative)}' cannot be read ({error})") from error
    if not is_inside:
        is_link = ".." not in Path(relative).parts and not Path(relative).is_absolute()
        cure = (
            f"a link leads to '{path.resolve()}', put the files there; or {UNDISTORT} copies them"
        )
        raise CaptureError(
            f"{where}: '{relative}' leaves the capture folder; "
            + (cure if is_link else "paths must stay inside")
        )
    return path
