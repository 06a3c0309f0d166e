"""Find and read the small files of a recording: every message names the file and what it should hold."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.camera import Intrinsics
from digs_warp.checks import CaptureError
from digs_warp.data.images import read_image

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")


def read_numbers(path: Path, shape: tuple[int, ...], what: str) -> np.ndarray:
    """Return the numbers of a text file, separated by blanks or commas, lines with # left out.

    Raises:
        CaptureError: missing, no numbers, or another count than ``shape`` has.
    """
    if not path.is_file():
        raise CaptureError(f"{what} '{path}': no such file")
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    words = re.split(
        r"[\s,]+", " ".join(line for line in lines if not line.startswith("#")).strip()
    )
    try:
        return np.array([float(word) for word in words if word]).reshape(shape)
    except ValueError as error:
        raise CaptureError(f"{what} '{path}': expected {shape} numbers ({error})") from None


def numbered_files(folder: Path, suffixes: Sequence[str], prefix: str = "") -> dict[int, Path]:
    """Return the files PREFIX + NUMBER + SUFFIX of a folder by number, in that order."""
    found = {}
    for path in folder.glob(f"{prefix}*"):
        digits = path.stem.removeprefix(prefix)
        if path.suffix.lower() in suffixes and digits.isdecimal():
            found[int(digits)] = path
    return dict(sorted(found.items()))


def require_files(folder: Path, found: dict[int, Path], what: str) -> dict[int, Path]:
    """Return ``found``, or raise when it is empty."""
    if not found:
        raise CaptureError(f"recording '{folder}': no {what}; is this the right --from?")
    return found


def image_size(path: Path) -> tuple[int, int]:
    """Return (width, height) of an image file."""
    height, width = read_image(path, "image").shape[:2]
    return width, height


def intrinsics_of_matrix(
    matrix: np.ndarray, size: tuple[int, int], integer_centers: bool
) -> Intrinsics:
    """Return the camera of a matrix K (3, 3) or larger.

    Args:
        matrix: [[fx, 0, cx], [0, fy, cy], ...].
        size: (width, height).
        integer_centers: whether the first pixel's centre is (0, 0) in the file, not (0.5, 0.5).
    """
    k = Intrinsics(
        *size, float(matrix[0, 0]), float(matrix[1, 1]), float(matrix[0, 2]), float(matrix[1, 2])
    )
    return replace(k, cx=k.cx + 0.5, cy=k.cy + 0.5) if integer_centers else k
