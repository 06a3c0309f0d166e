"""A new result takes the place of an old one in the same folder; files that no run wrote stay.

The new result is made in FOLDER/.digs-warp.unfinished, on the same disk. When it is complete, the old files
are deleted and the new ones renamed, the lists of files first. A process that is killed between leaves a part
of the new result in its place and the rest in the hidden folder, never old files among new ones; --resume
makes what it misses there again.
"""

import json
import os
import shutil
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath

from digs_warp.checks import DigsError
from digs_warp.record.disk import sync
from digs_warp.record.files import read_text, write_atomically
from digs_warp.record.interruption import deferred_interrupt
from digs_warp.record.layout import LOCK, MANIFEST, RUN_RECORD, UNFINISHED
from digs_warp.record.manifest import Manifest, recorded_files
from digs_warp.record.run_log import RunRecord
from digs_warp.words import first_few


def our_files(folder: Path) -> set[str]:
    """Return the files below ``folder`` that runs of ours wrote, by relative names with "/"."""
    found = set()
    for parent, _, names in _walk(folder):
        if MANIFEST in names:
            found |= {parent / name for name in (*Manifest.read(parent).names, MANIFEST)}
        if RUN_RECORD in names and _is_our_record(parent):
            found.add(parent / RUN_RECORD)
    ours = {path.relative_to(folder).as_posix() for path in found if not path.is_symlink()}
    return ours & _all_files(folder)  # nothing behind a link to a folder


def replace_result(folder: Path) -> None:
    """Put the complete result in ``folder``/.digs-warp.unfinished into the place of the old one.

    Raises:
        DigsError: a file that no run of ours wrote is in the way, or the disk is full. The old result is
            unchanged, and the new one stays where it is.
    """
    unfinished = folder / UNFINISHED
    _rename_in_records(unfinished, folder)
    with recorded_files(unfinished, resume=True) as manifest:
        for name in _all_files(unfinished) - our_files(unfinished):  # libraries wrote them
            manifest.add(unfinished / name)
    new, old = _all_files(unfinished), our_files(folder)
    others = _all_files(folder) - old
    above = {str(parent) for name in new for parent in PurePosixPath(name).parents}
    filled = {str(parent) for name in others for parent in PurePosixPath(name).parents}
    if in_the_way := others & (new | above) | new & filled:
        raise DigsError(
            f"'{folder}': the new result needs the names {first_few(sorted(in_the_way), 3)}, but no run "
            "wrote those files; move them away or name another folder"
        )
    with deferred_interrupt() as interruption:
        _delete(folder, old)
        for name in sorted(new, key=lambda name: (PurePosixPath(name).name != MANIFEST, name)):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            os.replace(unfinished / name, folder / name)
        for parent in {(folder / name).parent for name in new}:
            sync(parent)
        shutil.rmtree(unfinished, ignore_errors=True)
    if interruption.asked is not None:
        interruption.end()


def _delete(folder: Path, names: Collection[str]) -> None:
    """Delete files, the lists of them last, and the folders that are empty without them."""
    for name in sorted(names, key=lambda name: (PurePosixPath(name).name == MANIFEST, name)):
        (folder / name).unlink(missing_ok=True)
    above = {parent for name in names for parent in PurePosixPath(name).parents if parent.name}
    for parent in sorted(above, key=lambda each: len(each.parts), reverse=True):
        with suppress(OSError):  # not empty, or gone
            (folder / parent).rmdir()


def _rename_in_records(unfinished: Path, folder: Path) -> None:
    """Let the records of runs name files where they will be."""
    old, new = (json.dumps(str(each))[1:-1] for each in (unfinished, folder))
    for path in unfinished.rglob(RUN_RECORD):
        before = read_text(path, "run record")
        if (after := before.replace(old, new)) != before:
            write_atomically(path, after.encode())


def _all_files(folder: Path) -> set[str]:
    """Return the names of all files and links below ``folder``, without those of a run in progress."""
    return {
        (parent / name).relative_to(folder).as_posix()
        for parent, folders, files in _walk(folder)
        for name in (*files, *(each for each in folders if (parent / each).is_symlink()))
        if name != LOCK
    }


def _walk(folder: Path) -> Iterator[tuple[Path, list[str], list[str]]]:
    for parent, folders, files in os.walk(folder):
        folders[:] = [name for name in folders if name != UNFINISHED]
        yield Path(parent), folders, files


def _is_our_record(folder: Path) -> bool:
    try:
        return RunRecord.find(folder) is not None
    except DigsError:  # damaged: nobody can say whose it is
        return False
