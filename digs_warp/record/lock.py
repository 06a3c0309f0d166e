"""Locks: one process at a time writes a folder. The system releases the locks of a killed process.

A lock is deleted while it is held: filelock takes a lock again whose file is gone. Whoever takes it deletes
the temporary files and folders that killed processes left behind.
"""

import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from digs_warp.checks import DigsError
from digs_warp.record.layout import LOCK

if TYPE_CHECKING:
    from filelock import FileLock


# .NAME.PROCESS.tmp: what is being written is called so until it is complete.
_TEMPORARY = re.compile(r"\.(?P<name>.+)\.[1-9][0-9]*\.tmp")


@contextmanager
def sole_writer(folder: Path) -> Iterator[None]:
    """Keep other processes and threads from writing ``folder`` during the block.

    The folder is made if it is missing, and removed afterwards if nothing was written. What killed processes
    left half-written in it is deleted. The same thread may lock a folder again.

    Raises:
        DigsError: another process or thread is writing it, or it cannot be made.
    """
    folder = Path(folder)
    made = _make(folder)
    try:
        lock = _take(folder)
        try:
            if lock.lock_counter == 1:
                remove_leftovers(folder)
            yield
        finally:
            if lock.lock_counter == 1:
                Path(lock.lock_file).unlink(missing_ok=True)
            lock.release()
    finally:
        for each in made:
            with suppress(OSError):  # something is in it
                each.rmdir()


@contextmanager
def taking_turns(path: Path) -> Iterator[None]:
    """Wait until no other process is making the file or folder ``path``, and keep others from it.

    The lock is a hidden file beside ``path``.
    """
    from filelock import FileLock

    path = Path(path).resolve()
    path.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(path.with_name(f".{path.name}.lock")) as lock:
        try:
            yield
        finally:
            Path(lock.lock_file).unlink(missing_ok=True)


def _make(folder: Path) -> list[Path]:
    """Make a folder and those above it; return the new ones, innermost first."""
    missing = [each for each in (folder, *folder.absolute().parents) if not each.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unusable(folder, error) from error
    return missing


def _take(folder: Path) -> "FileLock":
    from filelock import FileLock, Timeout

    lock = FileLock(folder.resolve() / LOCK, is_singleton=True)
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise DigsError(
            f"'{folder}': another run is writing to this folder; wait until it has ended, or name another "
            "folder"
        ) from None
    except OSError as error:
        raise _unusable(folder, error) from error
    return lock


def _unusable(folder: Path, error: OSError) -> DigsError:
    return DigsError(
        f"'{folder}': cannot be written ({error.strerror or error}); name another folder"
    )


def remove_leftovers(folder: Path) -> None:
    """Delete what processes that are gone left half-written in ``folder`` and below."""
    for parent, folders, files in os.walk(folder):
        for name in filter(_TEMPORARY.fullmatch, (*folders, *files)):
            _delete(Path(parent, name))
        folders[:] = [name for name in folders if not _TEMPORARY.fullmatch(name)]


def remove_leftovers_of(path: Path) -> None:
    """Delete what processes that are gone left of ``path``, beside it."""
    if path.parent.is_dir():
        for name in os.listdir(path.parent):
            match = _TEMPORARY.fullmatch(name)
            if match is not None and match["name"] == path.name:
                _delete(path.with_name(name))


def _delete(path: Path) -> None:
    """Delete a file or folder; a link is none of ours."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    elif not path.is_symlink():
        path.unlink(missing_ok=True)
