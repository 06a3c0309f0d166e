"""The last step of every write: complete and synced to the disk before it gets its name, or an error.

Only `digs_warp.record.files` and `digs_warp.record.manifest` use this; everything else writes through
`digs_warp.record.files`.
"""

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from io import FileIO
from pathlib import Path

from digs_warp.checks import DigsError

# What the system reports when a file does not fit: disk full, quota used up, file too large for the file
# system or the limit of the process, and a failing disk.
SPACE_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


def temporary_beside(path: Path) -> Path:
    """Return the name beside ``path`` of what is not complete yet: ``.NAME.PROCESS.tmp``."""
    return path.with_name(f".{path.name}.{os.getpid()}.tmp")


@contextmanager
def reported(path: Path, needed: int | None = None) -> Iterator[None]:
    """Turn an `OSError` of the block into a `DigsError` that names ``path``.

    Args:
        path: what the block writes.
        needed: its size [bytes], if known; a full disk's message says it.
    """
    try:
        yield
    except OSError as error:
        raise DigsError(_explained(path, error, needed)) from error


def put(path: Path, data: bytes) -> None:
    """Write ``data``, sync it, and only then give it the name ``path``; an old file is replaced only then.

    The name itself is not synced: a power cut may leave the old file or none, but never half a file.

    Raises:
        OSError: it cannot be written; nothing is left behind.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = temporary_beside(path)
    try:
        with temporary.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def append(path: Path, line: bytes) -> None:
    """Append a line that ends with a newline, whole or not at all; half a line that a kill left is cut off.

    Raises:
        OSError: it cannot be written; the file is as before.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+b", buffering=0) as file:
        size = _whole_lines(file)
        file.truncate(size)
        if file.write(line) != len(line):
            file.truncate(size)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def rename(unfinished: Path, path: Path) -> None:
    """Rename a complete file or folder, and sync the folder that it is in."""
    os.replace(unfinished, path)
    sync(path.parent)


def sync(path: Path) -> None:
    """Wait until a file, or the list of names in a folder, is on the disk.

    Raises:
        OSError: the disk does not take it. Some file systems say only now that they are full.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except PermissionError:  # Windows opens no folders
        return
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno != errno.EINVAL:  # a file system that cannot sync folders
            raise
    finally:
        os.close(descriptor)


def check_room(path: Path, size: int) -> None:
    """Check that the disk of ``path`` has room for ``size`` more bytes, for libraries that crash without.

    Raises:
        DigsError: it has not.
    """
    temporary = temporary_beside(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with reported(path, size), temporary.open("wb") as file:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, size)
            elif shutil.disk_usage(path.parent).free < size:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    finally:
        temporary.unlink(missing_ok=True)


def out_of_space(path: Path, problem: str, needed: int | None = None) -> DigsError:
    """Return the error for a file that does not fit on the disk."""
    needs = f", needs {_in_words(needed)}" if needed is not None else ""
    above = next(folder for folder in path.absolute().parents if folder.is_dir())
    try:
        free = f", {_in_words(shutil.disk_usage(above).free)} free"
    except OSError:
        free = ""
    return DigsError(
        f"'{path}': cannot be written ({problem}{needs}{free}). Free space on that disk, then run again, "
        "with --resume where the command has it; a file that was there before is unchanged"
    )


def _whole_lines(file: FileIO) -> int:
    """Return how many bytes of a file end with its last newline."""
    size = file.seek(0, os.SEEK_END)
    file.seek(max(0, size - 1))
    if file.read(1) in (b"", b"\n"):
        return size
    file.seek(0)
    return file.readall().rfind(b"\n") + 1


def _explained(path: Path, error: OSError, needed: int | None) -> str:
    problem = error.strerror or str(error)
    if error.errno in SPACE_ERRORS:
        return str(out_of_space(path, problem, needed))
    return f"'{path}': cannot be written ({problem}); a file that was there before is unchanged"


def _in_words(size: int) -> str:
    for unit, one in (("GB", 10**9), ("MB", 10**6), ("kB", 10**3)):
        if size >= one:
            return f"{size / one:.1f} {unit}"
    return f"{size} bytes"
