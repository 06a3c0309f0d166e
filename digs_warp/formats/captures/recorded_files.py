"""Find and read the small files of a recording: every message names the file and what it should hold."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.geometry.camera import Intrinsics
from digs_warp.record.files import read_text

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")


@contextmanager
def expecting(where: str, what: str) -> Iterator[None]:
    """Raise a `CaptureError` when the block finds missing keys or wrong values in a file.

    Args:
        where: the file.
        what: what it should hold.
    """
    try:
        yield
    except CaptureError:
        raise
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise CaptureError(f"{where}: expected {what} ({error!r})") from None


def is_readable(path: Path) -> bool:
    """Whether there is a file; False for names that the system does not allow."""
    try:
        return path.is_file()
    except (OSError, ValueError):  # too long; with a NUL
        return False


def missing(folder: Path, name: str) -> str:
    """Return what to say of a file that an index names and that is not there, with the likely right name.

    Args:
        folder: of the recording.
        name: as the index has it; from another system it may have backslashes, an absolute path, or another
            case.
    """
    parts = [part for part in re.split(r"[/\\]", name) if part not in ("", ".", "..")]
    tails = ["/".join(parts[n:]) for n in range(len(parts))]
    found = next((near for tail in tails if (near := _in_any_case(folder, tail))), None)
    if found is None:
        return f"'{name}' does not exist in '{folder}'; copy it there, or correct the name"
    return f"'{name}' does not exist, but '{found}' does; correct the name"


def _in_any_case(folder: Path, name: str) -> str | None:
    """Return the name of the file in the folder that differs in nothing but case, if there is one."""
    at, found = folder, []
    for part in name.split("/"):
        try:
            near = next((p for p in at.iterdir() if p.name.lower() == part.lower()), None)
        except OSError:
            return None
        if near is None:
            return None
        at, found = near, [*found, near.name]
    return "/".join(found) if is_readable(at) else None


def read_numbers(path: Path, shape: tuple[int, ...], what: str) -> np.ndarray:
    """Return the numbers of a text file, separated by blanks or commas, without lines that begin with #.

    Raises:
        CaptureError: missing, no numbers, or a count that does not fit ``shape``.
    """
    lines = read_text(path, what, errors="replace").splitlines()
    words = re.split(
        r"[\s,]+", " ".join(line for line in lines if not line.startswith("#")).strip()
    )
    with expecting(f"{what} '{path}'", f"{shape} numbers"):
        return np.array([float(word) for word in words if word]).reshape(shape)


def numbered_files(folder: Path, start: str, suffixes: Sequence[str]) -> dict[int, Path]:
    """Return the files START + NUMBER + SUFFIX below a folder by number, ascending; START may have a /."""
    prefix = start.rpartition("/")[2]
    found = {}
    for path in folder.glob(f"{start}*"):
        digits = path.stem.removeprefix(prefix)
        if path.suffix.lower() in suffixes and digits.isdecimal():
            found[int(digits)] = path
    return dict(sorted(found.items()))


def integer_centered_camera(matrix: np.ndarray, size: tuple[int, int]) -> Intrinsics:
    """Return the camera of a matrix that counts the center of the first pixel as (0, 0).

    Args:
        matrix: K, [[fx, 0, cx], [0, fy, cy], ...], (3, 3) or larger.
        size: (width, height).
    """
    k = Intrinsics(
        *size, float(matrix[0, 0]), float(matrix[1, 1]), float(matrix[0, 2]), float(matrix[1, 2])
    )
    return replace(k, cx=k.cx + 0.5, cy=k.cy + 0.5)
