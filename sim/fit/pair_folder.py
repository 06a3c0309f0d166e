"""Reads a stereo pair with true disparity: two rectified images, a disparity map, a calibration.

Two layouts: Middlebury's (im0.png, im1.png, disp0.pfm, calib.txt; Scharstein et al. 2014), and left.png,
right.png, disp.npz, calib.json.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.bounds import IMAGE
from digs_warp.checks import DigsError, check_shape, require_file, require_folder
from digs_warp.data.images import read_image
from digs_warp.geometry.camera import Intrinsics
from digs_warp.record.fields import ABOVE_ZERO, Fields
from digs_warp.record.files import read_json, read_text

HINT = (
    "A pair has im0.png, im1.png, disp0.pfm and calib.txt, or "
    "left.png, right.png, disp.npz and calib.json."
)


@dataclass(frozen=True, eq=False)
class Pair:
    """A stereo pair with true disparity.

    Attributes:
        name: of its folder.
        intrinsics: of the left eye.
        baseline: [m].
        left, right: sRGB, (height, width, 3), uint8.
        disparity: true one of the left image [px], (height, width), float64, NaN where it is not known.
    """

    name: str
    intrinsics: Intrinsics
    baseline: float
    left: np.ndarray
    right: np.ndarray
    disparity: np.ndarray


def is_pair(folder: Path) -> bool:
    """Whether a folder looks like a stereo pair."""
    return any((folder / name).is_file() for name in ("calib.txt", "disp0.pfm", "disp.npz"))


def read_pair(folder: Path) -> Pair:
    """Read a stereo pair with true disparity.

    Raises:
        DigsError: a file that is missing or broken, or images of different sizes.
    """
    folder = require_folder(folder, "stereo pair", HINT)
    is_ours = (folder / "calib.json").is_file()
    names = ("left.png", "right.png") if is_ours else ("im0.png", "im1.png")
    left, right = (_read_color(folder / name) for name in names)
    disparity = _read_npz(folder / "disp.npz") if is_ours else read_pfm(folder / "disp0.pfm")
    check_shape(f"right image '{folder / names[1]}'", right, left.shape)
    check_shape(f"disparity of '{folder}'", disparity, left.shape[:2])
    if not np.isfinite(disparity).any():
        raise DigsError(f"stereo pair '{folder}': no disparity is known; copy the files again")
    focal, cx, cy, baseline = (_read_json if is_ours else _read_txt)(folder)
    k = Intrinsics(left.shape[1], left.shape[0], focal, focal, cx, cy)
    return Pair(folder.resolve().name, k, baseline, left, right, disparity)


def _read_color(path: Path) -> np.ndarray:
    pixels = read_image(path)
    if pixels.dtype != np.uint8:
        raise DigsError(f"image '{path}': {pixels.dtype}, expected 8 bits per channel; convert it")
    return np.ascontiguousarray(
        np.repeat(pixels, 3, axis=2) if pixels.shape[2] < 3 else pixels[..., :3]
    )


def _known(disparity: np.ndarray) -> np.ndarray:
    """Return disparity with NaN where it is not known, which files mark by infinity or 0."""
    disparity = disparity.astype(np.float64)
    disparity[~(np.isfinite(disparity) & (disparity > 0))] = np.nan
    return disparity


def _read_npz(path: Path) -> np.ndarray:
    what = f"true disparity '{path}'"
    try:
        with np.load(require_file(path, "true disparity")) as arrays:
            found = arrays[arrays.files[0]]
    except DigsError:
        raise
    except Exception as error:  # zipfile and NumPy raise many kinds
        raise DigsError(f"{what}: cannot be read ({error}); copy it again") from error
    if found.ndim != 2 or found.dtype.kind not in "fiu":
        raise DigsError(
            f"{what}: {found.ndim} dimensions of {found.dtype}, expected an image of numbers"
        )
    return _known(found)


def read_pfm(path: Path) -> np.ndarray:
    """Return a gray PFM image, (height, width), float64, NaN where it has infinity or 0.

    Three lines of text (Pf, width and height, scale whose sign is the byte order), then rows from below.
    """
    what = f"true disparity '{path}'"
    data = require_file(path, "true disparity").read_bytes()
    lines = data.split(b"\n", 3)
    try:
        kind, size, scale, pixels = lines
        width, height = (int(word) for word in size.split())
        order = "<" if float(scale) < 0 else ">"
    except ValueError:
        raise DigsError(f"{what}: not a PFM image; expected three lines of header") from None
    if kind.strip() != b"Pf" or width < 1 or height < 1:
        raise DigsError(f"{what}: not a gray PFM image; expected 'Pf' and a size")
    IMAGE.check(what, width * height)
    if len(pixels) < 4 * width * height:
        raise DigsError(
            f"{what}: {len(pixels):,} bytes of pixels, expected {4 * width * height:,}; copy it again"
        )
    values = np.frombuffer(pixels, f"{order}f4", width * height).reshape(height, width)
    return _known(values[::-1])


def _read_json(folder: Path) -> tuple[float, float, float, float]:
    path = folder / "calib.json"
    fields = Fields.of(read_json(path, "calibration"), f"calibration '{path}'")
    focal = fields.number("fx_px", ABOVE_ZERO, what="pixels above 0")
    cx = fields.number("cx_left_px" if "cx_left_px" in fields else "cx_px")
    cy = fields.number("cy_px")
    if "baseline_m" in fields:
        return focal, cx, cy, fields.number("baseline_m", ABOVE_ZERO, what="metres above 0")
    return focal, cx, cy, fields.number("baseline_mm", ABOVE_ZERO, what="mm above 0") / 1000


def _read_txt(folder: Path) -> tuple[float, float, float, float]:
    """Read Middlebury's calib.txt: cam0=[f 0 cx; 0 f cy; 0 0 1] and baseline=... in millimetres."""
    path = folder / "calib.txt"
    lines = read_text(require_file(path, "calibration"), "calibration").splitlines()
    values = dict(line.split("=", 1) for line in lines if "=" in line)
    try:
        matrix = [float(word) for word in values["cam0"].strip(" []").replace(";", " ").split()]
        focal, cx, cy, baseline = matrix[0], matrix[2], matrix[5], float(values["baseline"]) / 1000
    except (KeyError, ValueError, IndexError):
        raise DigsError(
            f"calibration '{path}': expected lines 'cam0=[f 0 cx; 0 f cy; 0 0 1]' and 'baseline=...' in mm, "
            "as Middlebury writes them"
        ) from None
    if not (np.isfinite([focal, cx, cy, baseline]).all() and focal > 0 < baseline):
        raise DigsError(f"calibration '{path}': focal length and baseline have to be above 0")
    return focal, cx, cy, baseline
