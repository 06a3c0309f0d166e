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
from digs_warp.interchange.recordings.recording import RecordedFrame, Recording
from digs_warp.log import read_json

MM_PER_METRE = 1000.0
FLOAT_SUFFIXES = (".exr", ".npy")
CALIBRATION = "calibration.json"
FRAME_RATE = 30.0


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
    return Recording(
        folder,
        tuple(
            RecordedFrame(
                image=left,
                intrinsics=k,
                time=number / FRAME_RATE,
                depth=depths.get(number),
                depth_units_per_metre=_units(depths.get(number)),
                right=rights.get(number) if baseline is not None else None,
            )
            for number, left in lefts.items()
        ),
        baseline=baseline,
    )


def _units(depth: Path | None) -> float:
    return 1.0 if depth is None or depth.suffix in FLOAT_SUFFIXES else MM_PER_METRE
