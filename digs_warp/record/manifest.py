"""The manifest: which files runs of ours wrote into a folder, so that nobody else's are kept or replaced.

``files.jsonl`` has a JSON object per line: the path relative to the folder, and ``gone`` for a file that was
deleted. While a run goes on, a line is appended *before* the file appears, so after a kill every file of ours
is listed; at the end, the lines are sorted and each file has one.

run.json and the manifest itself are not listed: every folder of ours may have both.
"""

import json
import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from digs_warp.checks import DigsError
from digs_warp.record.disk import append, put, reported
from digs_warp.record.fields import parse_json
from digs_warp.record.layout import MANIFEST, RUN_RECORD
from digs_warp.words import first_few

logger = logging.getLogger(__name__)


@dataclass(eq=False)
class Manifest:
    """The files that runs of ours wrote into ``folder``, an absolute path; ``names`` are relative."""

    folder: Path
    names: set[str] = field(default_factory=set)
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    @staticmethod
    def read(folder: Path) -> "Manifest":
        """Return the manifest of a folder; empty if it has none. Lines that are damaged do not count."""
        manifest = Manifest(Path(folder).resolve())
        try:
            lines = (manifest.folder / MANIFEST).read_text(encoding="utf-8", errors="replace")
        except OSError:
            return manifest
        for line in lines.splitlines():
            with suppress(ValueError, KeyError, TypeError):
                entry = parse_json(line)
                path = PurePosixPath(entry["path"])
                if entry.get("gone"):
                    manifest.names.discard(str(path))
                elif not path.is_absolute() and ".." not in path.parts:
                    manifest.names.add(str(path))
        return manifest

    def lists(self, path: Path) -> bool:
        """Whether a run of ours wrote the file at ``path``, which need not be there."""
        return self._name(path) in self.names

    def is_complete(self) -> bool:
        """Whether files are listed, and all of them are there."""
        return bool(self.names) and not self._missing()

    def drop_missing(self) -> list[str]:
        """Take files that are gone off the list, and say so in the log; return their names."""
        lost = self._missing()
        for name in lost:
            self.forget(self.folder / name)
        if lost:
            logger.warning(
                "'%s': %s missing and made again: %s",
                *(self.folder, "1 file is" if len(lost) == 1 else f"{len(lost)} files are"),
                first_few(lost),
            )
        return lost

    def add(self, path: Path) -> None:
        """List the file at ``path``, which is about to appear."""
        name = self._name(path)
        with self._lock:
            if name not in (*self.names, MANIFEST, RUN_RECORD):
                self._append({"path": name})
                self.names.add(name)

    def forget(self, path: Path) -> None:
        """Take a file that is about to be deleted off the list."""
        name = self._name(path)
        with self._lock:
            if name in self.names:
                self._append({"path": name, "gone": True})
                self.names.remove(name)

    def save(self) -> None:
        """Write the manifest with one line per file, sorted."""
        data = "".join(json.dumps({"path": name}) + "\n" for name in sorted(self.names)).encode()
        path = self.folder / MANIFEST
        with self._lock:
            if data or path.exists():
                with reported(path, len(data)):
                    put(path, data)

    def _missing(self) -> list[str]:
        return [name for name in sorted(self.names) if not (self.folder / name).is_file()]

    def _append(self, entry: dict[str, str | bool]) -> None:
        path = self.folder / MANIFEST
        line = json.dumps(entry).encode() + b"\n"
        with reported(path, len(line)):
            append(path, line)

    def _name(self, path: Path) -> str:
        place = _absolute(path)
        if not place.is_relative_to(self.folder):  # behind a link to a folder elsewhere
            place = path
        return place.relative_to(self.folder).as_posix()


# Manifests that are being written, by folder.
_open: dict[Path, Manifest] = {}


@contextmanager
def recorded_files(folder: Path, resume: bool = False) -> Iterator[Manifest]:
    """List every file that `digs_warp.record.files` writes below ``folder`` during the block.

    This holds for all threads. In a folder within a recorded one, the files are in the inner manifest only.

    Args:
        folder: the folder of a run; created with its first file.
        resume: go on with the manifest of an earlier run; otherwise it starts empty.
    """
    folder = Path(folder).resolve()
    if folder in _open:
        yield _open[folder]
        return
    manifest = Manifest.read(folder) if resume else Manifest(folder)
    if (folder / MANIFEST).exists():
        manifest.save()
    _open[folder] = manifest
    try:
        yield manifest
    except BaseException:
        with suppress(DigsError):  # the first error says more; the lines so far remain
            manifest.save()
        raise
    else:
        manifest.save()
    finally:
        del _open[folder]


def manifest_of(path: Path) -> Manifest | None:
    """Return the manifest that is being written and that lists files at ``path``; the innermost one."""
    if not _open:
        return None
    return next((_open[above] for above in _absolute(path).parents if above in _open), None)


def is_kept(path: Path) -> bool:
    """Whether a file is there for a resumed run to keep: listed, where a manifest is being written."""
    manifest = manifest_of(path)
    return path.is_file() and (manifest is None or manifest.lists(path))


def _absolute(path: Path) -> Path:
    """Return the path with the links of its folder followed; the file itself may be a link."""
    path = Path(path)
    return path.parent.resolve() / path.name
