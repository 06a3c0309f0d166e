"""Frames exported from a ZED recording (SVO): rectified left images, optional right ones, and depth.

    left000000.png  right000000.png  depth000000.png or .exr, .npy          in one folder
    calibration.json                                   fx, fy, cx, cy of the rectified images, baseline [m]

Integer depth is in millimetres, float depth in metres; NaN is unknown, -inf too near, +inf too far. Poses are
not exported: structure from motion finds them.
"""

from pathlib import Path

from digs_warp.checks import CaptureError
from digs_warp.formats.captures.recorded_files import IMAGE_SUFFIXES, numbered_files
from digs_warp.formats.captures.recording import MM_PER_METRE, NumberedFiles, Recording
from digs_warp.geometry.camera import Intrinsics
from digs_warp.record.fields import ABOVE_ZERO, Fields
from digs_warp.record.files import read_json

CALIBRATION = "calibration.json"

# No camera that a hand carries has eyes this far apart [m]; the SDK gives millimetres unless told otherwise.
WIDEST = 2.0


def read_zed(folder: Path) -> Recording:
    """Read left images and depth as the ZED SDK's export samples write them.

    Raises:
        CaptureError: no left images, or no usable calibration.json.
    """
    files = NumberedFiles.find(folder, "left", "depth", (".png", ".exr", ".npy"))
    path = folder / CALIBRATION
    content = read_json(path, "calibration of the rectified left camera")
    calibration = Fields(content, f"'{path}'", CaptureError)
    fx, fy = (calibration.number(key, ABOVE_ZERO, what="pixels above 0") for key in ("fx", "fy"))
    baseline = calibration.number("baseline", ABOVE_ZERO, default=None, what="metres above 0")
    if baseline is not None and baseline > WIDEST:
        raise CaptureError(
            f"'{path}': baseline is {baseline:g}, expected metres, at most {WIDEST:g}; if it is in "
            f"millimetres, as the ZED SDK has it, write {baseline / MM_PER_METRE:g}"
        )
    return files.recording(
        Intrinsics(*files.image_size, fx, fy, calibration.number("cx"), calibration.number("cy")),
        {},
        baseline=baseline,
        right=numbered_files(folder, "right", IMAGE_SUFFIXES) if baseline is not None else {},
    )
