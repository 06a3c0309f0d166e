"""The manifest: which files a run wrote into its folder, with the size and SHA-256 of each.

``files.jsonl`` has one JSON object per line: the path relative to the folder, ``bytes`` and ``sha256``; both
are null for a file that the run deleted, and missing for one that a library changes in place. While a run
goes on, a line is appended *before* the file appears, so after a kill every file of ours is listed. At the
end, the lines are sorted and each file has one.

run.json and the manifest itself are not listed: every folder of ours may have both.
"""

import hashlib
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

NOT_LISTED = (MANIFEST, RUN_RECORD)


@dataclass(frozen=True)
class Content:
    """What identifies the content of a file."""

    size: int
    sha256: str

    @staticmethod
    def of(data: bytes) -> "Content":
        """Return the identity of ``data``."""
        return Content(len(data), hashlib.sha256(data).hexdigest())

    @staticmethod
    def of_file(path: Path) -> "Content":
        """Return the identity of what is in a file now.

        Raises:
            OSError: it cannot be read.
        """
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
            return Content(file.tell(), digest)


@dataclass(eq=False)
class Manifest:
    """The files that runs of ours wrote into ``folder``.

    Attributes:
        folder: an absolute path.
        files: path relative to the folder, with "/" -> what it holds. Of a file that was being replaced when
            the process was killed, the old and the new content are both listed; of one that changes in place,
            none.
    """

    folder: Path
    files: dict[str, tuple[Content, ...]] = field(default_factory=dict)
    _lock: threading.RLock = field(default_factory=threading.RLock, repr=False)

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
                manifest._take(parse_json(line))
        return manifest

    def lists(self, path: Path) -> bool:
        """Whether a run of ours wrote the file at ``path``, which need not be there."""
        return self._name(path) in self.files

    def is_whole(self, path: Path) -> bool:
        """Whether a run of ours wrote the file at ``path``, and it is as it was written. Reads the file.

        Of a file that changes in place, this is not known: it counts as whole.
        """
        expected = self.files.get(self._name(path))
        if not expected:
            return expected is not None
        try:
            size = path.stat().st_size
            return size in {content.size for content in expected} and (
                Content.of_file(path) in expected
            )
        except OSError:
            return False

    def all_whole(self) -> bool:
        """Whether files are listed, and all of them are as they were written. Reads them all."""
        return bool(self.files) and all(self.is_whole(self.folder / name) for name in self.files)

    def drop_damaged(self) -> list[str]:
        """Delete the listed files that are not as they were written, and say so in the log.

        Returns:
            The names of those, and of listed files that are missing; they have to be made again.
        """
        lost = [name for name in sorted(self.files) if not self.is_whole(self.folder / name)]
        for name in lost:
            (self.folder / name).unlink(missing_ok=True)
            self.forget(self.folder / name)
        if lost:
            logger.warning(
                "'%s': %s damaged or missing and made again: %s",
                *(self.folder, "1 file is" if len(lost) == 1 else f"{len(lost)} files are"),
                first_few(lost),
            )
        return lost

    def claim(self, path: Path) -> None:
        """List the file at ``path`` without its content, which changes."""
        name = self._name(path)
        with self._lock:
            if self.files.get(name) != ():
                self._append({"path": name})
                self.files[name] = ()

    @contextmanager
    def replacing(self, path: Path, content: Content) -> Iterator[None]:
        """List what the file at ``path`` holds after the block, which puts it there."""
        name = self._name(path)
        if name in NOT_LISTED:
            yield
            return
        with self._lock:
            before = self.files.get(name)
            self._append(_line(name, content))
            self.files[name] = (*(before or ())[-1:], content)
        try:
            yield
        except BaseException:
            with self._lock:
                if before is None:
                    del self.files[name]
                else:
                    self.files[name] = before
            raise
        with self._lock:
            self.files[name] = (content,)

    def forget(self, path: Path) -> None:
        """Take a file that is about to be deleted off the list."""
        name = self._name(path)
        with self._lock:
            if self.files.pop(name, None) is not None:
                self._append({"path": name, "bytes": None, "sha256": None})

    def save(self) -> None:
        """Write the manifest with one line per file, sorted."""
        lines = [
            json.dumps(_line(name, content)) + "\n"
            for name in sorted(self.files)
            for content in self.files[name] or (None,)
        ]
        path = self.folder / MANIFEST
        data = "".join(lines).encode()
        with self._lock:
            if lines or path.exists():
                with reported(path, len(data)):
                    put(path, data)

    def _name(self, path: Path) -> str:
        place = _absolute(path)
        if not place.is_relative_to(self.folder):  # behind a link to a folder elsewhere
            place = path
        return place.relative_to(self.folder).as_posix()

    def _take(self, line: dict[str, str | int | None]) -> None:
        name = line["path"]
        if not isinstance(name, str) or not _is_below(name):
            raise ValueError(name)
        size, digest = line.get("bytes"), line.get("sha256")
        if "bytes" not in line:
            self.files[name] = ()
        elif isinstance(size, int) and isinstance(digest, str):
            self.files[name] = (*self.files.get(name, ())[-1:], Content(size, digest))
        else:
            self.files.pop(name, None)

    def _append(self, entry: dict[str, str | int | None]) -> None:
        path = self.folder / MANIFEST
        line = json.dumps(entry).encode() + b"\n"
        with reported(path, len(line)):
            append(path, line)


def _line(name: str, content: Content | None) -> dict[str, str | int | None]:
    if content is None:
        return {"path": name}
    return {"path": name, "bytes": content.size, "sha256": content.sha256}


def _is_below(name: str) -> bool:
    path = PurePosixPath(name)
    return not path.is_absolute() and ".." not in path.parts


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
