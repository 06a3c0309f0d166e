"""Frames exported from a ZED recording (SVO): rectified left images, optional right ones, and depth.

    left000000.png  right000000.png  depth000000.png or .exr, .npy          in one folder
    calibration.json                                   fx, fy, cx, cy of the rectified images, baseline [m]

Integer depth is in millimetres, float depth in metres; NaN is unknown, -inf too near, +inf too far. Poses are
not exported: structure from motion finds them.
"""

from pathlib import Path

from digs_warp.camera import Intrinsics
from digs_warp.checks import CaptureError
from digs_warp.interchange.recordings.files import (
    IMAGE_SUFFIXES,
    image_size,
    numbered_files,
    require_files,
)
from digs_warp.interchange.recordings.recording import Recording, numbered_frames
from digs_warp.record.files import read_json

MM_PER_METRE = 1000.0
FLOAT_SUFFIXES = (".exr", ".npy")
CALIBRATION = "calibration.json"


def read_zed(folder: Path) -> Recording:
    """Read left images and depth as the ZED SDK's export samples write them.

    Raises:
        CaptureError: no left images, or no usable calibration.json.
    """
    lefts = require_files(folder, numbered_files(folder, IMAGE_SUFFIXES, "left"), "left000000.png")
    rights = numbered_files(folder, IMAGE_SUFFIXES, "right")
    depths = numbered_files(folder, (".png", *FLOAT_SUFFIXES), "depth")
    calibration = read_json(folder / CALIBRATION, "calibration of the rectified left camera")
    try:
        fx, fy, cx, cy = (float(calibration[key]) for key in ("fx", "fy", "cx", "cy"))
        baseline = float(calibration["baseline"]) if "baseline" in calibration else None
    except (KeyError, TypeError, ValueError) as error:
        raise CaptureError(
            f"'{folder / CALIBRATION}': expected numbers fx, fy, cx, cy [px] and baseline [m] ({error!r})"
        ) from None
    k = Intrinsics(*image_size(next(iter(lefts.values()))), fx, fy, cx, cy)
    frames = numbered_frames(
        lefts,
        k,
        depth=depths,
        depth_units_per_metre={number: _units(path) for number, path in depths.items()},
        right=rights if baseline is not None else {},
    )
    return Recording(folder, frames, baseline=baseline)


def _units(depth: Path) -> float:
    return 1.0 if depth.suffix in FLOAT_SUFFIXES else MM_PER_METRE
