"""A new result takes the place of an old one in the same folder; files that no run wrote stay.

The new result is made in FOLDER/.digs-warp.unfinished, on the same disk. When it is complete, the old files
are deleted and the new ones renamed, the lists of files first. A process that is killed between leaves a part
of the new result in its place and the rest in the hidden folder, never old files among new ones; --resume
makes what it misses there again.
"""

import os
import shutil
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.record.disk import sync
from digs_warp.record.files import read_json, to_json, write_atomically
from digs_warp.record.interruption import deferred_interrupt
from digs_warp.record.layout import LOCK, MANIFEST, RUN_RECORD, UNFINISHED
from digs_warp.record.manifest import Content, Manifest, recorded_files
from digs_warp.record.run_log import RunRecord
from digs_warp.words import first_few


def our_files(folder: Path) -> set[str]:
    """Return the files below ``folder`` that runs of ours wrote and nobody changed; reads them all.

    The names are relative, with "/".
    """
    return {
        name
        for name, manifest in _listed_files(folder)
        if manifest is None or manifest.is_whole(folder / name)
    }


def check_place(folder: Path, writes: Sequence[str]) -> None:
    """Check that a new result would take no name of a file that no run of ours wrote.

    Args:
        folder: holds an old result.
        writes: the names that the new result may have, relative to the folder, as patterns with ``*``.

    Raises:
        DigsError: a file is in the way.
    """
    patterns = {*writes, RUN_RECORD, MANIFEST}
    for pattern in writes:  # no file may stand where a folder is needed
        patterns |= {str(parent) for parent in PurePosixPath(pattern).parents}
    foreign = _all_files(folder) - our_files(folder)
    _refuse(folder, [name for name in foreign if any(fnmatchcase(name, each) for each in patterns)])


def replace_result(folder: Path) -> None:
    """Put the complete result in ``folder``/.digs-warp.unfinished into the place of the old one.

    Raises:
        DigsError: a file that no run of ours wrote is in the way, or the disk is full. The old result is
            unchanged, and the new one stays where it is.
    """
    unfinished = folder / UNFINISHED
    _rename_in_records(unfinished, folder)
    _list_all(unfinished)
    new, old = _all_files(unfinished), our_files(folder)
    others = _all_files(folder) - old
    above = {str(parent) for name in new for parent in PurePosixPath(name).parents}
    blocked = {name for name in new if (folder / name).is_dir() and _holds(others, name)}
    _refuse(folder, others & (new | above) | blocked)
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
    for path in unfinished.rglob(RUN_RECORD):
        before = read_json(path, "run record")
        after = _renamed(before, str(unfinished), str(folder))
        if after != before:
            write_atomically(path, to_json(after).encode())


def _renamed(value: Any, old: str, new: str) -> Any:
    if isinstance(value, dict):
        return {name: _renamed(each, old, new) for name, each in value.items()}
    if isinstance(value, list):
        return [_renamed(each, old, new) for each in value]
    return value.replace(old, new) if isinstance(value, str) else value


def _list_all(unfinished: Path) -> None:
    """List what libraries wrote by themselves, such as COLMAP's database, in the manifest of a result."""
    listed = {name for name, _ in _listed_files(unfinished)}
    with recorded_files(unfinished, resume=True) as manifest:
        for name in sorted(_all_files(unfinished) - listed):
            path = unfinished / name
            with manifest.replacing(path, Content.of_file(path)):
                pass


def _listed_files(folder: Path) -> Iterator[tuple[str, Manifest | None]]:
    """Yield the files that a run lists, with the manifest; also manifests and records, which none lists."""
    there = _all_files(folder)  # nothing behind a link to a folder
    for parent, _, names in _walk(folder):
        if MANIFEST not in names and RUN_RECORD not in names:
            continue
        manifest = Manifest.read(parent)
        found = {parent / name: manifest for name in manifest.files}
        found |= {parent / MANIFEST: None}
        if _is_our_record(parent):
            found |= {parent / RUN_RECORD: None}
        for path, its in found.items():
            name = path.relative_to(folder).as_posix()
            if name in there and not path.is_symlink():
                yield name, its


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


def _holds(names: Collection[str], folder: str) -> bool:
    return any(name.startswith(f"{folder}/") for name in names)


def _is_our_record(folder: Path) -> bool:
    try:
        return RunRecord.find(folder) is not None
    except DigsError:  # damaged: nobody can say whose it is
        return False


def _refuse(folder: Path, in_the_way: Collection[str]) -> None:
    if not in_the_way:
        return
    raise DigsError(
        f"'{folder}': the new result needs the names {first_few(sorted(in_the_way), 3)}, but those files "
        "were not written by a run, or were changed since; move them away or name another folder"
    )
