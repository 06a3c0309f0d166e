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
    expected, needed = _undisturbed(case, inputs, disk)
    walked = Walked()
    size, step = PAGE, max(PAGE, needed // UNKNOWN_STEPS)
    while least := _try(case, inputs, disk, size, expected, walked):
        size = max(least, size + PAGE) if least > PAGE else size + step
    return walked


def try_sizes(case: Case, inputs: Path, disk: Path, shares: tuple[float, ...]) -> Walked:
    """Run a command on disks of some shares of the room that its result takes."""
    expected, needed = _undisturbed(case, inputs, disk)
    walked = Walked()
    for share in shares:
        _try(case, inputs, disk, max(PAGE, int(share * needed)), expected, walked)
    return walked


def try_limits(case: Case, inputs: Path, disk: Path, shares: tuple[float, ...]) -> Walked:
    """Run a command under limits on the size of its files; for users who may not mount a disk."""
    code, said = run_command(case.command(inputs, disk / "expected"))
    assert code == 0, said
    expected = _contents(disk / "expected")
    walked = Walked()
    for number, share in enumerate(shares):
        folder = disk / str(number)
        with largest_file(int(share * max(map(len, expected.values())))):
            code, said = run_command(case.command(inputs, folder))
        _judge_failure(case, folder, code, said, expected, walked)
        _judge_repeat(case, inputs, folder, expected, walked)
    return walked


def _undisturbed(case: Case, inputs: Path, disk: Path) -> tuple[dict[str, bytes], int]:
    """Return the files of a run with room, and the room that they take [bytes]."""
    with small_disk(disk, ROOM):
        code, said = run_command(case.command(inputs, disk))
        assert code == 0, said
        space = os.statvfs(disk)
        return _contents(disk), (space.f_blocks - space.f_bfree) * space.f_frsize


def _try(
    case: Case, inputs: Path, disk: Path, size: int, expected: dict[str, bytes], walked: Walked
) -> int:
    """Run once on a disk of ``size``.

    Returns:
        The least room for the next try [bytes], one page where it is not known; 0: there was enough room.
    """
    with small_disk(disk, size):
        code, said = run_command(case.command(inputs, disk))
        if code == 0:
            _compare(case, f"with {size} bytes", _contents(disk), expected, walked)
            return 0
        _judge_failure(case, disk, code, said, expected, walked)
        space = os.statvfs(disk)
        resize(disk, ROOM)
        _judge_repeat(case, inputs, disk, expected, walked)
    if (needs := re.search(r"needs ([0-9.]+) (\w+)", said)) is None:
        return PAGE
    needed = float(needs[1]) * UNITS[needs[2]]
    return (space.f_blocks - space.f_bfree + math.ceil(needed / PAGE)) * PAGE


def _judge_failure(
    case: Case, disk: Path, code: int, said: str, expected: dict[str, bytes], walked: Walked
) -> None:
    walked.runs += 1
    named = re.search(r"'([^']+)': cannot be written .*Free space", said)
    if code != 1 or named is None or "Traceback" in said:
        walked.defects.append(f"{case.name}: exit code {code}, '{said[-300:]}'")
    else:
        walked.files.add(Path(named[1]).name)
    for name, content in _contents(disk).items():
        if name.endswith(".tmp") or "/.digs-warp.unfinished/" in f"/{name}":
            continue
        if not _is_whole(disk / name, content, expected.get(name)):
            walked.defects.append(f"{case.name}: '{name}' is truncated under its final name")
    left = list(disk.rglob(".*.tmp"))
    if left:
        walked.defects.append(f"{case.name}: {left[0].name} is left behind")


def _judge_repeat(
    case: Case, inputs: Path, disk: Path, expected: dict[str, bytes], walked: Walked
) -> None:
    code, said = run_command(case.command(inputs, disk, again=True))
    if code:
        walked.defects.append(f"{case.name}: with room again: exit code {code}, {said[-300:]}")
    else:
        _compare(case, "with room again", _contents(disk), expected, walked)


def _compare(
    case: Case, when: str, found: dict[str, bytes], expected: dict[str, bytes], walked: Walked
) -> None:
    different = sorted(found.keys() ^ expected.keys())
    if case.repeats:
        different += sorted(name for name in found if found[name] != expected.get(name))
    if different:
        walked.defects.append(f"{case.name}, {when}: {different[:3]} differ")


def _is_whole(path: Path, content: bytes, expected: bytes | None) -> bool:
    """Whether a file holds what an undisturbed run wrote, or a complete earlier version of it."""
    if content == expected or path.name in (RUN_RECORD, MANIFEST) or path.name.startswith("."):
        return True
    if path.suffix == ".json":  # a version of it: half an object is no JSON
        return _is_json(content)
    return any(Manifest.read(folder).is_whole(path) for folder in path.parents if _has(folder))


def _is_json(content: bytes) -> bool:
    try:
        json.loads(content)
    except ValueError:
        return False
    return True


def _has(folder: Path) -> bool:
    return (folder / MANIFEST).is_file()


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
