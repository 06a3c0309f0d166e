"""What transforms.json may say about cameras, units and versions: honored or refused, never skipped.

docs/formats.md lists the allowed keys and values.
"""

import logging
import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from digs_warp.checks import CaptureError
from digs_warp.data.about import About
from digs_warp.record.fields import is_number, shown
from digs_warp.words import did_you_mean

logger = logging.getLogger(__name__)

INDEX_NAME = "transforms.json"

# nerfstudio's key for the sparse points to start from.
POINTS_KEY = "ply_file_path"

FORMAT_VERSION = 1
DEPTH_UNIT = "metre"
PINHOLES = "make pinhole images with 'colmap image_undistorter'"
UNDISTORT = "'digs-warp convert FOLDER --from nerfstudio --out CAPTURE'"

# Camera models whose rays are those of a pinhole camera when all coefficients are zero.
CAMERA_MODELS = (
    *("PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE"),
    *("SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV"),
)
FISHEYE_MODEL = "OPENCV_FISHEYE"
COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")


@dataclass(frozen=True)
class Lens:
    """The camera model of a frame: its name, and its coefficients by name, zeros left out."""

    model: str
    coefficients: Mapping[str, float]

    @property
    def is_fisheye(self) -> bool:
        """Whether the coefficients k1 to k4 are those of a fisheye lens."""
        return self.model == FISHEYE_MODEL


def read_lens(index: dict[str, Any], entry: dict[str, Any], where: str) -> Lens:
    """Return the lens of a frame, whose keys override those of the index.

    Args:
        index: the content of transforms.json.
        entry: the frame's part of it.
        where: prefix of messages, which names the file.

    Raises:
        CaptureError: an unknown model, or a coefficient that is no number.
    """
    model = _value(index, entry, "camera_model", "PINHOLE")
    fisheye = _value(index, entry, "is_fisheye", False)
    if not isinstance(fisheye, bool):
        raise CaptureError(f"{where}: is_fisheye is {shown(fisheye)}, expected true or false")
    name = FISHEYE_MODEL if fisheye else str(model).upper()
    if name not in (*CAMERA_MODELS, FISHEYE_MODEL):
        raise CaptureError(
            f"{where}: camera_model is {shown(model)}, expected one of "
            f"{', '.join((*CAMERA_MODELS, FISHEYE_MODEL))}; {PINHOLES}"
        )
    coefficients = {key: _value(index, entry, key, 0.0) for key in COEFFICIENTS}
    for key, value in coefficients.items():
        if not is_number(value):
            raise CaptureError(f"{where}: {key} is {shown(value)}, expected a finite number")
    return Lens(name, {key: float(v) for key, v in coefficients.items() if v})


def require_pinhole(index: dict[str, Any], entry: dict[str, Any], where: str) -> None:
    """Raise a `CaptureError` unless the frame's images are free of distortion."""
    lens = read_lens(index, entry, where)
    if lens.coefficients or lens.is_fisheye:
        found = ", ".join(f"{key}={value:g}" for key, value in lens.coefficients.items())
        raise CaptureError(
            f"{where}: {lens.model} with {found or 'no coefficients'}, expected images without lens "
            f"distortion; {UNDISTORT} removes it"
        )


def require_metres(index: dict[str, Any], entry: dict[str, Any], where: str) -> None:
    """Raise a `CaptureError` unless poses are in metres, and depth in the unit of its kind of file."""
    check_depth_unit(index | entry, where)
    scale = _value(index, entry, "applied_scale", 1.0)
    if scale != 1.0:
        raise CaptureError(
            f"{where}: applied_scale is {shown(scale)}, expected 1: poses in metres; {UNDISTORT} removes it"
        )
    given = _value(index, entry, "depth_unit_scale_factor", None)
    depth = entry.get("depth_file_path")
    suffix = Path(depth).suffix.lower() if isinstance(depth, str) else ""
    # Arrays may be of either kind.
    expected = {"": given, ".exr": 1.0, ".npy": None}.get(suffix, 1e-3)
    if given is not None and not (is_number(given) and expected and math.isclose(given, expected)):
        wanted = f"{expected:g}" if expected else "none"
        raise CaptureError(
            f"{where}: depth_unit_scale_factor is {shown(given)}, expected {wanted} for '{depth}' (float "
            f"images in metres, 16-bit images in millimetres); {UNDISTORT} converts other images"
        )


# Keys of a frame that name a file have a value with such an ending.
FILES = (".png", ".jpg", ".jpeg", ".exr", ".npy", ".npz", ".tif", ".tiff", ".txt", ".json", ".ply")


def unread_files(entries: Sequence[Any], known: Collection[str]) -> Counter[str]:
    """Return what to say of keys of an index and its frames that name files and are not ``known``."""
    keys = Counter(
        key
        for entry in entries
        if isinstance(entry, dict)
        for key, value in entry.items()
        if key not in (*known, POINTS_KEY)
        and isinstance(value, str)
        and (key.endswith("_path") or value.lower().endswith(FILES))
    )
    return Counter({f"the files under '{key}' are not read": count for key, count in keys.items()})


def check_section(ours: dict[str, Any], where: str) -> None:
    """Refuse another version or unit in the part under ``digs_warp``; warn of keys that mean nothing.

    Raises:
        CaptureError: a newer or broken ``format_version``, or a ``depth_unit`` that is not "metre".
    """
    version = ours.get("format_version", FORMAT_VERSION)
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        raise CaptureError(
            f"{where}: format_version is {shown(version)}, expected {FORMAT_VERSION}"
        )
    if version > FORMAT_VERSION:
        raise CaptureError(
            f"{where}: format_version is {version}, written by a newer digs-warp; this one reads up to "
            f"{FORMAT_VERSION}. Update it."
        )
    check_depth_unit(ours, where)
    known = ["format_version", "depth_unit", "rig", *(each.name for each in fields(About))]
    for key in sorted(map(str, ours.keys() - set(known))):
        logger.warning("%s: unknown key '%s' has no effect%s", where, key, did_you_mean(key, known))


def check_depth_unit(section: dict[str, Any], where: str) -> None:
    """Raise a `CaptureError` if an object of the index names another unit of depth than metres."""
    unit = section.get("depth_unit", DEPTH_UNIT)
    if unit != DEPTH_UNIT:
        raise CaptureError(
            f"{where}: depth_unit is {shown(unit)}, expected '{DEPTH_UNIT}': float images in metres, or "
            "16-bit images, which are always in millimetres. Write the depth again."
        )


def _value(index: dict[str, Any], entry: dict[str, Any], key: str, default: Any) -> Any:
    return entry.get(key, index.get(key, default))
