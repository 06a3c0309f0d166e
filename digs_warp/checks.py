"""Checks at the door: every message names what was found, what was expected and what to do next."""

import math
import stat
from collections.abc import Sequence
from pathlib import Path

import numpy as np


class DigsError(ValueError):
    """Bad input. The command line prints the message alone and exits with code 1."""


class CaptureError(DigsError):
    """A capture folder that cannot be used."""


class MeshError(DigsError):
    """A mesh that cannot be used."""


class UsdError(DigsError):
    """A USD scene that cannot be written or read."""


def require_file(path: Path, what: str, hint: str = "") -> Path:
    """Return ``path``, or raise a `DigsError` when it is not a readable, non-empty file."""
    path = Path(path)
    if not path.exists():
        raise DigsError(f"{what} '{path}': no such file. {hint or 'Check the path.'}")
    require_regular(path, what, hint)
    if path.stat().st_size == 0:
        raise DigsError(f"{what} '{path}': the file is empty (0 bytes). Copy or export it again.")
    return path


def require_regular(path: Path, what: str, hint: str = "") -> None:
    """Raise a `DigsError` when an existing path is no file: opening a pipe or a device may never return."""
    if path.exists() and not path.is_file():
        raise DigsError(f"{what} '{path}': expected a file, found {kind_of(path)}. {hint}".rstrip())


def require_folder(path: Path, what: str, hint: str) -> Path:
    """Return ``path``, or raise a `CaptureError` when it is not a folder; ``hint`` says what one holds."""
    path = Path(path)
    if not path.exists():
        raise CaptureError(f"{what} '{path}': no such folder. Check the path.")
    if not path.is_dir():
        raise CaptureError(f"{what} '{path}': expected a folder, found {kind_of(path)}. {hint}")
    return path


def kind_of(path: Path) -> str:
    """Return what an existing path is, in words."""
    mode = Path(path).stat().st_mode
    kinds = {
        stat.S_IFDIR: "a folder",
        stat.S_IFIFO: "a named pipe",
        stat.S_IFSOCK: "a socket",
        stat.S_IFCHR: "a device",
        stat.S_IFBLK: "a device",
    }
    return kinds.get(stat.S_IFMT(mode), "a file")


def check_shape(name: str, array: np.ndarray, expected: Sequence[int | None]) -> np.ndarray:
    """Return ``array``, or raise when its shape differs. ``None`` in ``expected`` fits any length."""
    fits = array.ndim == len(expected) and all(
        want is None or got == want for got, want in zip(array.shape, expected, strict=True)
    )
    if not fits:
        wanted = "(" + ", ".join("any" if want is None else str(want) for want in expected) + ")"
        raise DigsError(f"{name}: shape {array.shape}, expected {wanted}")
    return array


def check_finite(name: str, array: np.ndarray) -> np.ndarray:
    """Return ``array``, or raise with the number of NaN and infinite values in it."""
    bad = int(np.size(array) - np.count_nonzero(np.isfinite(array)))
    if bad:
        raise DigsError(f"{name}: {bad} of {np.size(array)} values are NaN or infinite")
    return array


def check_positive(name: str, value: float) -> float:
    """Return ``value``, or raise when it is not a finite number above zero."""
    if not (_is_finite(value) and value > 0):
        raise DigsError(f"{name}: {value!r}, expected a finite number above 0")
    return value


def _is_finite(value: float) -> bool:
    """Whether a number is finite; an integer always is, even one that no float can hold."""
    return isinstance(value, int) or math.isfinite(value)
