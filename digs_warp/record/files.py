"""Atomic file writes, arrays and JSON."""

import json
import os
import shutil
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, is_dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from digs_warp.checks import DigsError, require_file


def write_atomically(path: Path, data: bytes) -> None:
    """Write ``data`` to a temporary file next to ``path``, then rename it: never a half-written file."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        temporary.write_bytes(data)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder to write into, then rename it to ``folder``: complete or absent.

    ``folder`` must be new or empty.
    """
    folder = Path(folder).resolve()
    unfinished = folder.with_name(f".{folder.name}.{os.getpid()}.tmp")
    try:
        yield unfinished
        os.replace(unfinished, folder)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def write_arrays(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write an ``.npz`` of named arrays; see `write_atomically`."""
    buffer = BytesIO()
    np.savez(buffer, **arrays)  # pyright: ignore[reportArgumentType]
    write_atomically(path, buffer.getvalue())


@contextmanager
def open_arrays(path: Path, what: str, fields: Sequence[str]) -> Iterator[Any]:
    """Open an ``.npz`` that `write_arrays` wrote; a context manager around everything that reads it.

    Raises:
        DigsError: the file is missing or broken, or an array read in the context is invalid.
    """
    require_file(path, what)
    try:
        with np.load(path, allow_pickle=False) as arrays:
            yield arrays
    except (
        BadZipFile,
        KeyError,
        EOFError,
        MemoryError,  # an array's header can claim any size
        OSError,
        RuntimeError,  # encrypted, or compressed in a way that Python does not know
        TypeError,
        ValueError,
        zlib.error,
    ) as error:
        raise DigsError(
            f"{what} '{path}': {error}; expected an .npz with {', '.join(fields)} "
            "as 'digs-warp reconstruct' writes it"
        ) from error


def to_json(value: Any) -> str:
    """Return readable JSON of dataclasses, paths, NumPy scalars and arrays."""
    return json.dumps(value, indent=2, default=_plain, allow_nan=False) + "\n"


def _plain(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"cannot write {type(value).__name__} as JSON")


def read_json(path: Path, what: str) -> dict[str, Any]:
    """Return a JSON object, or raise a `DigsError` that says where the file is broken."""
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DigsError(f"{what} '{path}': no such file") from None
    except OSError as error:
        raise DigsError(f"{what} '{path}': cannot be read ({error.strerror})") from error
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise DigsError(f"{what} '{path}': not valid JSON ({error}); write it again") from error
    if not isinstance(content, dict):
        raise DigsError(f"{what} '{path}': expected a JSON object, found {type(content).__name__}")
    return content
