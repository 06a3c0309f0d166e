"""Temporary files and folders that killed processes left behind."""

import os
import re
import shutil
from pathlib import Path

# .NAME.PROCESS.tmp: what is being written is called so until it is complete.
_TEMPORARY = re.compile(r"\.(?P<name>.+)\.(?P<process>[1-9][0-9]*)\.tmp")


def remove_leftovers(folder: Path) -> None:
    """Delete what processes that are gone left half-written in ``folder`` and below.

    What a living process may still be writing is kept, and so is everything with a different name.
    """
    for parent, folders, files in os.walk(folder):
        for name in [name for name in (*folders, *files) if _is_leftover(name)]:
            _delete(Path(parent, name))
        folders[:] = [name for name in folders if not _is_leftover(name)]


def remove_leftovers_of(path: Path) -> None:
    """Delete what processes that are gone left of ``path``, beside it."""
    if path.parent.is_dir():
        for name in os.listdir(path.parent):
            if _is_leftover(name, of=path.name):
                _delete(path.with_name(name))


def _is_leftover(name: str, of: str | None = None) -> bool:
    match = _TEMPORARY.fullmatch(name)
    return (
        match is not None and of in (None, match["name"]) and not _is_alive(int(match["process"]))
    )


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)  # sends nothing
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:  # somebody else's
        return True
    return True


def _delete(path: Path) -> None:
    """Delete a file or folder; a link is none of ours."""
    if path.is_symlink():
        return
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
