"""The one way to write a file, and arrays and JSON as files."""

import json
import shutil
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, is_dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from digs_warp.checks import DigsError, require_file
from digs_warp.record.disk import put, rename, reported, sync, temporary_beside
from digs_warp.record.manifest import Content, manifest_of, recorded_files


def write_atomically(path: Path, data: bytes) -> None:
    """Write ``data``: complete, synced to the disk and under its name, or not at all.

    Every write of the package ends here or in `new_file`. Where the manifest of a folder is being written
    (`digs_warp.record.manifest.recorded_files`), it lists the file.

    Raises:
        DigsError: the disk is full, or the file cannot be written; names the path, the space needed and the
            space free. A file that was there before is unchanged.
    """
    path = Path(path)
    with reported(path, len(data)), _listed(path, lambda: Content.of(data)):
        put(path, data)


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """Yield a temporary name for a library that writes by name; after the block the file is at ``path``.

    The name is the same as that of ``path``, in a temporary folder beside it; other files in that folder are
    deleted. Libraries report success for truncated files: a block has to check what it wrote, and raise
    `digs_warp.record.disk.out_of_space` if the file is not complete.

    Raises:
        DigsError: as `write_atomically` does.
    """
    path = Path(path)
    folder = temporary_beside(path)
    unfinished = folder / path.name
    try:
        with reported(path):
            folder.mkdir(parents=True, exist_ok=True)
            yield unfinished
            sync(unfinished)
            with _listed(path, lambda: Content.of_file(unfinished)):
                rename(unfinished, path)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def copy_file(source: Path, path: Path) -> None:
    """Copy a file; see `write_atomically`."""
    write_atomically(path, Path(source).read_bytes())


def copy_folder(source: Path, folder: Path) -> None:
    """Copy all files below ``source``; see `write_atomically`."""
    for path in sorted(source.rglob("*")):
        if path.is_file():
            copy_file(path, folder / path.relative_to(source))


def remove(path: Path) -> None:
    """Delete a file of ours, if it is there, and take it off the manifest that lists it."""
    manifest = manifest_of(path)
    if manifest is not None:
        manifest.forget(path)
    path.unlink(missing_ok=True)


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder to write into, then rename it to ``folder``: complete or absent.

    It gets a manifest. ``folder`` must be new or empty.
    """
    folder = Path(folder).resolve()
    unfinished = temporary_beside(folder)
    try:
        with recorded_files(unfinished):
            yield unfinished
        with reported(folder):
            rename(unfinished, folder)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


@contextmanager
def _listed(path: Path, content: Callable[[], Content]) -> Iterator[None]:
    manifest = manifest_of(path)
    if manifest is None:
        yield
        return
    with manifest.replacing(path, content()):
        yield


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
