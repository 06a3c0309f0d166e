"""Arrays as files of NumPy, ``.npz`` and ``.npy``; what they promise is checked before it is loaded."""

import tokenize
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

import numpy as np

from digs_warp.bounds import check_unpacked
from digs_warp.checks import DigsError, require_file
from digs_warp.record.files import write_atomically
from digs_warp.words import first_few

# What NumPy and zipfile raise for files that are damaged.
UNREADABLE = (
    AttributeError,  # an entry that is no array
    BadZipFile,
    KeyError,
    EOFError,
    MemoryError,
    OSError,
    RuntimeError,  # encrypted, packed in a way that Python does not know, or brackets without end
    SyntaxError,  # the header of an array is Python
    tokenize.TokenError,
    TypeError,
    ValueError,
    zlib.error,
)


def write_arrays(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write an ``.npz`` of named arrays; see `write_atomically`.

    Raises:
        DigsError: the suffix says that it is something else, or the file cannot be written.
    """
    if Path(path).suffix.lower() != ".npz":
        raise DigsError(f"'{path}': suffix '{Path(path).suffix}', expected .npz")
    buffer = BytesIO()
    np.savez(buffer, **arrays)  # pyright: ignore[reportArgumentType]
    write_atomically(path, buffer.getvalue())


@contextmanager
def open_arrays(path: Path, what: str, fields: Sequence[str]) -> Iterator[Any]:
    """Open an ``.npz`` that `write_arrays` wrote; a context manager around everything that reads it.

    Raises:
        DigsError: the file is missing or broken, promises more than it holds, or an array read in the
            context is invalid.
    """
    expected = f"expected an .npz with {', '.join(fields)}"
    check_archive(path, what, expected)
    try:
        with np.load(path, allow_pickle=False) as arrays:
            yield arrays
    except UNREADABLE as error:
        raise DigsError(f"{what} '{path}': {error}; {expected}") from error


def read_array(path: Path, what: str) -> np.ndarray:
    """Return the array in an ``.npy`` file, or of an ``.npz`` the only one, or that with the name ``what``.

    Raises:
        DigsError: the file is missing or broken, or promises more than it holds.
    """
    require_file(path, what)
    if path.suffix.lower() == ".npz":
        with open_arrays(path, what, ("one array",)) as arrays:
            names = [name for name in arrays if name == what] or list(arrays)
            if len(names) != 1:
                raise ValueError(f"it has {first_few(names)}, and none is called {what}")
            return arrays[names[0]]
    try:
        return np.load(path, allow_pickle=False)
    except UNREADABLE as error:
        raise DigsError(f"{what} '{path}': {error}; expected an .npy file") from error


def check_archive(path: Path, what: str, expected: str) -> None:
    """Check what the directory of an ``.npz`` promises.

    Raises:
        DigsError: missing, damaged, or far more than the file's size; says what was ``expected``.
    """
    require_file(path, what)
    where = f"{what} '{path}'"
    try:
        with ZipFile(path) as archive:
            members = archive.infolist()
            check_unpacked(where, path.stat().st_size, sum(each.file_size for each in members))
    except DigsError:
        raise
    except UNREADABLE as error:
        raise DigsError(f"{where}: {error}; {expected}") from error
