"""nerfstudio's transforms.json as other programs write it: JPEG images, lens distortion, often no depth.

Poses stay in nerfstudio's world, which ``applied_transform`` rotated to have z up; ``applied_scale`` is
undone, because depth is in metres. See https://docs.nerf.studio/quickstart/data_conventions.html.
"""

from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.camera import Intrinsics
from digs_warp.checks import CaptureError
from digs_warp.data.capture import INDEX_NAME
from digs_warp.data.images import image_size
from digs_warp.data.index_rules import (
    METRES_PER_FLOAT,
    check_depth_unit,
    check_section,
    is_number,
    metres_per_unit,
    read_lens,
)
from digs_warp.geometry import OPENCV_FROM_OPENGL
from digs_warp.interchange.captures.recorded_files import IMAGE_SUFFIXES
from digs_warp.interchange.captures.recording import RecordedFrame, Recording
from digs_warp.record.files import read_json

DISTORTION_KEYS = ("k1", "k2", "p1", "p2", "k3")


def read_nerfstudio(folder: Path) -> Recording:
    """Read a folder with transforms.json.

    Raises:
        CaptureError: no usable index, a fisheye lens, a missing image, another unit of depth than its images
            have, or distortion that differs between frames.
    """
    index = read_json(folder / INDEX_NAME, "nerfstudio index")
    entries = index.get("frames")
    if not isinstance(entries, list) or not entries:
        raise CaptureError(f"recording '{folder}': {INDEX_NAME} lists no frames")
    ours = index.get("digs_warp")
    if isinstance(ours, dict):
        check_section(ours, f"recording '{folder}', digs_warp in {INDEX_NAME}")
    scale = float(index.get("applied_scale", 1.0))
    frames = tuple(_frame(folder, index, entry, i, scale) for i, entry in enumerate(entries))
    lenses = {
        _distortion(index, entry, f"recording '{folder}', frame {i} of {INDEX_NAME}")
        for i, entry in enumerate(entries)
    }
    if len(lenses) > 1:
        raise CaptureError(
            f"recording '{folder}': {len(lenses)} different lens distortions, expected one; undistort "
            "the images"
        )
    lens = lenses.pop()
    rig = ours.get("rig", {}) if isinstance(ours, dict) else {}
    return Recording(
        folder, frames, distortion=lens if any(lens) else (), baseline=rig.get("baseline")
    )


def _frame(
    folder: Path, index: dict[str, Any], entry: dict[str, Any], number: int, scale: float
) -> RecordedFrame:
    where = f"recording '{folder}', frame {number} of {INDEX_NAME}"
    try:
        image = _image_path(folder, str(entry["file_path"]), where)
        matrix = np.array(entry["transform_matrix"], dtype=np.float64)
        matrix[:3, 3] /= scale
        time = float(_value(index, entry, "time", _value(index, entry, "timestamp", number)))
        intrinsics = _intrinsics(index, entry, image)
    except KeyError as error:
        raise CaptureError(f"{where}: no {error}") from None
    except (TypeError, ValueError, IndexError) as error:
        raise CaptureError(f"{where}: {error}") from None
    return RecordedFrame(
        image=image,
        intrinsics=intrinsics,
        time=time,
        world_from_cam=matrix @ OPENCV_FROM_OPENGL,
        depth=_optional(folder, entry, "depth_file_path", where),
        depth_units_per_metre=_units_per_metre(index, entry, where),
        mask=_optional(folder, entry, "mask_path", where),
        right=_optional(folder, entry, "right_file_path", where),
    )


def _distortion(index: dict[str, Any], entry: dict[str, Any], where: str) -> tuple[float, ...]:
    """Return the coefficients in the order of DISTORTION_KEYS; refuse lenses that need more."""
    lens = read_lens(index, entry, where)
    if more := sorted(lens.coefficients.keys() - set(DISTORTION_KEYS)):
        raise CaptureError(
            f"{where}: {lens.model} with {', '.join(more)}, expected only {', '.join(DISTORTION_KEYS)}; "
            "undistort the images first, for example with 'colmap image_undistorter'"
        )
    return tuple(lens.coefficients.get(key, 0.0) for key in DISTORTION_KEYS)


def _units_per_metre(index: dict[str, Any], entry: dict[str, Any], where: str) -> float:
    """Return how many units of the depth image make a metre: ``depth_unit_scale_factor`` may say it."""
    check_depth_unit(index | entry, where)
    depth = str(entry.get("depth_file_path"))
    usual = metres_per_unit(depth)
    given = _value(index, entry, "depth_unit_scale_factor", usual)
    if not is_number(given) or given <= 0 or (usual == METRES_PER_FLOAT and given != usual):
        raise CaptureError(
            f"{where}: depth_unit_scale_factor is {given!r} for '{depth}', expected metres per unit: 1 for "
            "float images, 0.001 or another number above 0 for 16-bit images; correct it"
        )
    return 1 / given


def _intrinsics(index: dict[str, Any], entry: dict[str, Any], image: Path) -> Intrinsics:
    """Return the camera: from the frame's keys, the shared ones, or the field of view of synthetic scenes."""
    if "w" in entry or "w" in index:
        size = int(_value(index, entry, "w")), int(_value(index, entry, "h"))
    else:
        size = image_size(image)
    if "fl_x" not in entry and "fl_x" not in index and "camera_angle_x" in index:
        return Intrinsics.from_fov(*size, float(np.rad2deg(float(index["camera_angle_x"]))))
    fx = float(_value(index, entry, "fl_x"))
    return Intrinsics(
        *size,
        fx,
        float(_value(index, entry, "fl_y", fx)),
        float(_value(index, entry, "cx", size[0] / 2)),
        float(_value(index, entry, "cy", size[1] / 2)),
    )


def _value(index: dict[str, Any], entry: dict[str, Any], key: str, default: Any = None) -> Any:
    """Return the frame's value, else the shared one, else ``default``; if that is None, raise KeyError."""
    if default is None:
        return entry[key] if key in entry else index[key]
    return entry.get(key, index.get(key, default))


def _image_path(folder: Path, name: str, where: str) -> Path:
    path = folder / name
    candidates = [path, *(path.with_name(path.name + suffix) for suffix in IMAGE_SUFFIXES)]
    found = next((candidate for candidate in candidates if candidate.is_file()), None)
    if found is None:
        raise CaptureError(f"{where}: '{name}' does not exist")
    return found


def _optional(folder: Path, entry: dict[str, Any], key: str, where: str) -> Path | None:
    if not entry.get(key):
        return None
    if not (folder / entry[key]).is_file():
        raise CaptureError(f"{where}, {key}: '{entry[key]}' does not exist")
    return folder / entry[key]
