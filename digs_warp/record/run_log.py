"""The record of a run: run.json with versions, settings and stage times."""

import json
import os
import platform
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.record.files import read_json, to_json, write_atomically
from digs_warp.record.layout import RUN_RECORD
from digs_warp.record.progress import announced
from digs_warp.record.typed import from_json

PACKAGE = Path(__file__).resolve().parents[1]
REPORTED_PACKAGES = ("digs-warp", "warp-lang", "numpy", "trimesh", "usd-core", "OpenImageIO")


def versions() -> dict[str, str]:
    """Return the package versions that can affect a result."""
    found = {"python": platform.python_version()}
    for package in REPORTED_PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


@cache
def source_commit(package: Path = PACKAGE) -> str | None:
    """Return the checked-out git commit of the code; None for an installed package, or without git."""
    if not (package.parent / ".git").exists():
        return None
    command = ["git", "-C", str(package.parent), "rev-parse", "HEAD"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=10)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()


@contextmanager
def timed(
    seconds: dict[str, float], name: str, clock: Callable[[], float] = time.perf_counter
) -> Iterator[None]:
    """Add the time of a block [s] to ``seconds[name]``, even if it fails."""
    start = clock()
    try:
        yield
    finally:
        seconds[name] = seconds.get(name, 0.0) + clock() - start


@dataclass(frozen=True)
class RunRecord:
    """The content of a run.json, as plain JSON values.

    Attributes:
        command: the command that ran, such as "reconstruct".
        versions: of the packages that can affect a result, by name.
        settings: all settings of the command, defaults included.
        commit: git commit of the code; None for an installed package.
        machine: the machine that it ran on.
        seconds: wall-clock time of each stage [s].
        results: the figures that the command reports.
    """

    command: str
    versions: dict[str, Any]
    settings: dict[str, Any]
    commit: str | None = None
    machine: dict[str, Any] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    results: dict[str, Any] = field(default_factory=dict)

    @staticmethod
    def load(path: Path) -> "RunRecord":
        """Read a record.

        Raises:
            DigsError: the file is missing or broken, or is from another program.
        """
        content = read_json(path, "run record")
        if not _is_ours(content):
            raise DigsError(
                f"run record '{path}': not one of digs-warp, which has {', '.join(_NEEDED)}; give a "
                "folder that a command wrote"
            )
        return from_json(RunRecord, content, f"run record '{path}'", remedy="run again")

    @staticmethod
    def find(folder: Path) -> "RunRecord | None":
        """Read the record of a folder; None if it has none, or one from another program.

        Raises:
            DigsError: the file is broken.
        """
        path = Path(folder) / RUN_RECORD
        if not path.is_file() or not _is_ours(read_json(path, "run record")):
            return None
        return RunRecord.load(path)

    def save(self, path: Path) -> None:
        """Write the record; the file appears only when it is complete."""
        write_atomically(path, to_json(vars(self)).encode())


# Keys that every record has, and that distinguish it from another program's run.json.
_NEEDED = ("command", "versions", "settings")


def _is_ours(content: dict[str, Any]) -> bool:
    return content.keys() >= set(_NEEDED)


@dataclass
class RunLog:
    """The record of a run in progress: settings, stage times [s], results."""

    command: str
    settings: Any
    seconds: dict[str, float] = field(default_factory=dict)
    results: dict[str, Any] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Announce and time a stage; if it is entered twice, its times add up."""
        with announced(name), timed(self.seconds, name):
            yield

    @contextmanager
    def saved(self, path: Path) -> Iterator[None]:
        """Save the record after a block, even if the block is interrupted."""
        try:
            yield
        except BaseException:
            with suppress(DigsError):  # a full disk, say: the first error says more
                self.save(path)
            raise
        self.save(path)

    def continue_from(self, path: Path) -> RunRecord | None:
        """Take over the stage times of an interrupted run; return its record, or None without one.

        Raises:
            DigsError: the run was started with other settings; the message names them.
        """
        if not Path(path).is_file():
            return None
        before = RunRecord.load(path)
        if different := _differences(before.settings, self.record().settings):
            raise DigsError(
                f"'{Path(path).parent}': started with other settings ({', '.join(different)}); resume "
                "with the same ones, or start again with --overwrite"
            )
        self.seconds |= before.seconds
        return before

    def record(self) -> RunRecord:
        """Return the current record."""
        return RunRecord(
            command=self.command,
            versions=versions(),
            settings=json.loads(to_json(self.settings)),
            commit=source_commit(),
            machine={"system": platform.platform(), "cores": os.cpu_count()},
            seconds={name: round(value, 4) for name, value in self.seconds.items()},
            results=dict(self.results),
        )

    def save(self, path: Path) -> None:
        """Write the record; safe to call after every stage."""
        self.record().save(path)


def _differences(before: Any, now: Any, name: str = "settings") -> list[str]:
    """Return "name old -> new" for every setting that differs between two JSON values."""
    if not (isinstance(before, dict) and isinstance(now, dict)):
        return [] if before == now else [f"{name} {before} -> {now}"]
    keys = dict.fromkeys([*now, *before])
    return [line for key in keys for line in _differences(before.get(key), now.get(key), key)]
