"""What a run leaves behind: run.json with versions, settings and stage times."""

import json
import os
import platform
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.record.files import read_json, to_json, write_atomically

PACKAGE = Path(__file__).resolve().parents[1]
REPORTED_PACKAGES = ("digs-warp", "warp-lang", "numpy", "trimesh", "usd-core", "OpenImageIO")


def versions() -> dict[str, str]:
    """Return the versions that decide a result."""
    found = {"python": platform.python_version()}
    for package in REPORTED_PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def source_commit(package: Path = PACKAGE) -> str | None:
    """Return the git commit that is checked out where the code lies; None for an installed package.

    Reads git's own files: no program to be missing, and nothing to wait for.
    """
    try:
        git = package.parent / ".git"
        if git.is_file():  # a worktree: "gitdir: PATH"
            git = package.parent / git.read_text().removeprefix("gitdir:").strip()
        head = (git / "HEAD").read_text().strip()
        if not head.startswith("ref: "):
            return head
        branch = head.removeprefix("ref: ")
        common = git / "commondir"
        shared = git / common.read_text().strip() if common.is_file() else git
        if (shared / branch).is_file():
            return (shared / branch).read_text().strip()
        packed = (line.split() for line in (shared / "packed-refs").read_text().splitlines())
        return next((fields[0] for fields in packed if fields[1:] == [branch]), None)
    except (OSError, UnicodeDecodeError):
        return None


@contextmanager
def timed(
    seconds: dict[str, float], name: str, clock: Callable[[], float] = time.perf_counter
) -> Iterator[None]:
    """Add what a block takes on a clock [s] to ``seconds[name]``, also when it fails."""
    start = clock()
    try:
        yield
    finally:
        seconds[name] = seconds.get(name, 0.0) + clock() - start


@dataclass
class RunLog:
    """The record of one run: settings, versions, stage times [s], results. Saved as run.json."""

    command: str
    settings: Any
    seconds: dict[str, float] = field(default_factory=dict)
    results: dict[str, Any] = field(default_factory=dict)

    def stage(self, name: str) -> AbstractContextManager[None]:
        """Time a stage; times of a stage entered twice add up."""
        return timed(self.seconds, name)

    def continue_from(self, path: Path) -> None:
        """Take over the stage times of an interrupted run; without a record there this does nothing.

        Raises:
            DigsError: the run was begun with other settings; the message names them.
        """
        if not Path(path).is_file():
            return
        before = read_json(path, "run record")
        now = json.loads(to_json(self.settings))
        if different := _differences(before.get("settings"), now):
            raise DigsError(
                f"'{Path(path).parent}': begun with other settings ({', '.join(different)}); resume "
                "with the same ones, or start anew with --overwrite"
            )
        self.seconds |= before.get("seconds", {})

    def save(self, path: Path) -> None:
        """Write the record; safe to call after every stage."""
        record = {
            "command": self.command,
            "versions": versions(),
            "commit": source_commit(),
            "machine": {"system": platform.platform(), "cores": os.cpu_count()},
            "settings": self.settings,
            "seconds": {name: round(value, 4) for name, value in self.seconds.items()},
            "results": self.results,
        }
        write_atomically(path, to_json(record).encode())


def _differences(before: Any, now: Any, name: str = "settings") -> list[str]:
    """Return "name old -> new" for every setting that differs between two JSON values."""
    if not (isinstance(before, dict) and isinstance(now, dict)):
        return [] if before == now else [f"{name} {before} -> {now}"]
    keys = dict.fromkeys([*now, *before])
    return [line for key in keys for line in _differences(before.get(key), now.get(key), key)]
