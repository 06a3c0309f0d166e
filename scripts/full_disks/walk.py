"""One command on disks of growing size: it fails with a message, and with room gives the same result."""

import json
import math
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from digs_warp.masks.masks import SETTINGS
from digs_warp.record.layout import MANIFEST, MASKS, RUN_RECORD
from digs_warp.record.manifest import Manifest
from full_disks.cases import Case, run_command
from full_disks.disk import PAGE, largest_file, resize, small_disk

ROOM = 1 << 30

# Some messages do not say how much room is needed: then the disk grows by this share of the result.
UNKNOWN_STEPS = 40

UNITS = {"bytes": 1, "kB": 10**3, "MB": 10**6, "GB": 10**9}

# Values in results that differ between any two runs.
_TIMES = re.compile(rb'"(training_)?seconds": [0-9.e-]+')


@dataclass
class Walked:
    """What happened to one command.

    Attributes:
        runs: how often the disk ran full.
        files: the files at which it did, as the messages name them.
        defects: what went wrong, a sentence each.
    """

    runs: int = 0
    files: set[str] = field(default_factory=set)
    defects: list[str] = field(default_factory=list)


def walk(case: Case, inputs: Path, disk: Path) -> Walked:
    """Run a command on a disk of one page, and then on disks with just the room for what failed before."""
    runs, needed = _undisturbed(case, inputs, disk)
    size, step = PAGE, max(PAGE, needed // UNKNOWN_STEPS)
    while least := runs.on_disk(disk, size):
        size = max(least, size + PAGE) if least > PAGE else size + step
    return runs.walked


def try_sizes(case: Case, inputs: Path, disk: Path, shares: tuple[float, ...]) -> Walked:
    """Run a command on disks of some shares of the room that its result takes."""
    runs, needed = _undisturbed(case, inputs, disk)
    for share in shares:
        runs.on_disk(disk, max(PAGE, int(share * needed)))
    return runs.walked


def try_limits(case: Case, inputs: Path, disk: Path, shares: tuple[float, ...]) -> Walked:
    """Run a command under limits on the size of its files; for users who may not mount a disk."""
    code, said = run_command(case.command(inputs, disk / "expected"))
    assert code == 0, said
    runs = _Runs(case, inputs, _contents(disk / "expected"))
    for number, share in enumerate(shares):
        folder = disk / str(number)
        with largest_file(int(share * max(map(len, runs.expected.values())))):
            code, said = run_command(case.command(inputs, folder))
        runs.judge_failure(folder, code, said)
        runs.judge_repeat(folder)
    return runs.walked


def _undisturbed(case: Case, inputs: Path, disk: Path) -> tuple["_Runs", int]:
    """Run with room; return what other runs are compared with, and the room that the result takes [bytes]."""
    with small_disk(disk, ROOM):
        code, said = run_command(case.command(inputs, disk))
        assert code == 0, said
        return _Runs(case, inputs, _contents(disk)), _used_pages(disk) * PAGE


def _used_pages(disk: Path) -> int:
    space = os.statvfs(disk)
    return (space.f_blocks - space.f_bfree) * space.f_frsize // PAGE


@dataclass
class _Runs:
    """The runs of one command, each compared with the files of one that nothing disturbed."""

    case: Case
    inputs: Path
    expected: dict[str, bytes]
    walked: Walked = field(default_factory=Walked)

    def on_disk(self, disk: Path, size: int) -> int:
        """Run once on a disk of ``size``.

        Returns:
            The least room for the next try [bytes], one page where it is not known; 0: there was enough room.
        """
        with small_disk(disk, size):
            code, said = run_command(self.case.command(self.inputs, disk))
            if code == 0:
                self._compare(f"with {size} bytes", _contents(disk))
                return 0
            self.judge_failure(disk, code, said)
            used = _used_pages(disk)
            resize(disk, ROOM)
            self.judge_repeat(disk)
        if (needs := re.search(r"needs ([0-9.]+) (\w+)", said)) is None:
            return PAGE
        return (used + math.ceil(float(needs[1]) * UNITS[needs[2]] / PAGE)) * PAGE

    def judge_failure(self, disk: Path, code: int, said: str) -> None:
        """Note whether the message is clear, and what it left."""
        self.walked.runs += 1
        named = re.search(r"'([^']+)': cannot be written .*Free space", said)
        if code != 1 or named is None or "Traceback" in said:
            self._defect(f": exit code {code}, '{said[-300:]}'")
        else:
            self.walked.files.add(Path(named[1]).name)
        for name, content in _contents(disk).items():
            unfinished = name.endswith(".tmp") or "/.digs-warp.unfinished/" in f"/{name}"
            if not unfinished and not _is_whole(disk / name, content, self.expected.get(name)):
                self._defect(f": '{name}' is truncated under its final name")
        if left := list(disk.rglob(".*.tmp")):
            self._defect(f": {left[0].name} is left behind")

    def judge_repeat(self, disk: Path) -> None:
        """Run again, with room, and note what differs."""
        code, said = run_command(self.case.command(self.inputs, disk, again=True))
        if code:
            self._defect(f": with room again: exit code {code}, {said[-300:]}")
        else:
            self._compare("with room again", _contents(disk))

    def _compare(self, when: str, found: dict[str, bytes]) -> None:
        different = sorted(found.keys() ^ self.expected.keys())
        if self.case.repeats:
            different += sorted(n for n in found if found[n] != self.expected.get(n))
        if different:
            self._defect(f", {when}: {different[:3]} differ")

    def _defect(self, what: str) -> None:
        self.walked.defects.append(f"{self.case.name}{what}")


def _is_whole(path: Path, content: bytes, expected: bytes | None) -> bool:
    """Whether a file holds what an undisturbed run wrote, or a complete earlier version of it."""
    if content == expected or path.name in (RUN_RECORD, MANIFEST) or path.name.startswith("."):
        return True
    if path.suffix == ".json":  # a version of it: half an object is no JSON
        try:
            json.loads(content)
        except ValueError:
            return False
        return True
    listing = [folder for folder in path.parents if (folder / MANIFEST).is_file()]
    return any(Manifest.read(folder).is_whole(path) for folder in listing)


def _contents(disk: Path) -> dict[str, bytes]:
    """Return the files on the disk, without what differs between any two runs."""
    return dict(_files(disk))


def _files(disk: Path) -> Iterator[tuple[str, bytes]]:
    for path in sorted(disk.rglob("*")):
        if not path.is_file():
            continue
        name, content = path.relative_to(disk).as_posix(), path.read_bytes()
        if path.name == MANIFEST:
            listed = [json.loads(line)["path"] for line in content.splitlines() if line]
            yield name, json.dumps(sorted(set(listed))).encode()
        elif path.name == RUN_RECORD:
            yield name, b""
        elif path.parent.name == MASKS and path.name == SETTINGS:
            yield name, b""  # a hash of the times of files
        elif path.suffix in (".jsonl", ".json"):
            yield name, _TIMES.sub(b"", content)
        elif path.suffix not in (".db", ".html"):
            yield name, content
