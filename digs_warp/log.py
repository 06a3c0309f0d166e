"""What a run leaves behind (run.json: versions, settings, stage times) and progress bars."""

import json
import os
import platform
import sys
import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass, field, is_dataclass
from importlib.metadata import PackageNotFoundError, version
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from tqdm import tqdm

from digs_warp.checks import DigsError, require_file

REPORTED_PACKAGES = ("digs-warp", "warp-lang", "numpy", "trimesh", "usd-core", "OpenImageIO")

# Library calls are silent; the command line turns the bars on.
_show_progress = False


def show_progress(shown: bool = True) -> None:
    """Turn progress bars on stderr on or off for the whole process."""
    global _show_progress
    _show_progress = shown


def progress(total: int, label: str, unit: str = "it", initial: int = 0) -> "tqdm[Any]":
    """Return a progress bar with a time estimate; use it as a context manager and `update` it."""
    interactive = sys.stderr.isatty()
    return tqdm(
        total=total,
        initial=initial,
        desc=label,
        unit=unit,
        disable=not _show_progress,
        # In a log file every refresh is a line: a few are enough, and a bar inside another moves no cursor.
        mininterval=0.2 if interactive else 15.0,
        position=None if interactive else 0,
        ascii=not interactive,
        dynamic_ncols=interactive,
    )


def write_atomically(path: Path, data: bytes) -> None:
    """Write ``data`` to a temporary name beside ``path``, then rename: never a half-written file."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        temporary.write_bytes(data)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_arrays(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write an ``.npz`` of named arrays; see `write_atomically`."""
    buffer = BytesIO()
    np.savez(buffer, **arrays)  # pyright: ignore[reportArgumentType]
    write_atomically(path, buffer.getvalue())


@contextmanager
def open_arrays(path: Path, what: str, fields: Sequence[str]) -> Iterator[Any]:
    """Open an ``.npz`` that `write_arrays` wrote; use it as a context manager around all that reads it.

    Raises:
        DigsError: the file is missing or broken, or what is read in the context does not fit.
    """
    require_file(path, what)
    try:
        with np.load(path, allow_pickle=False) as arrays:
            yield arrays
    except (
        BadZipFile,
        KeyError,
        EOFError,
        MemoryError,  # an array's header may promise any size
        OSError,
        RuntimeError,  # encrypted, or a compression that Python does not know
        TypeError,
        ValueError,
        zlib.error,
    ) as error:
        raise DigsError(
            f"{what} '{path}': {error}; expected an .npz with {', '.join(fields)} "
            "as 'digs-warp reconstruct' writes it"
        ) from error


def to_json(value: Any) -> str:
    """Return readable JSON of dataclasses, paths, NumPy scalars and arrays."""
    return json.dumps(value, indent=2, default=_plain, allow_nan=False) + "\n"


def _plain(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"cannot write {type(value).__name__} as JSON")


def read_json(path: Path, what: str) -> dict[str, Any]:
    """Return a JSON object, or raise a `DigsError` that says where the file breaks off."""
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DigsError(f"{what} '{path}': no such file") from None
    except OSError as error:
        raise DigsError(f"{what} '{path}': cannot be read ({error.strerror})") from error
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise DigsError(f"{what} '{path}': not valid JSON ({error}); write it again") from error
    if not isinstance(content, dict):
        raise DigsError(f"{what} '{path}': expected a JSON object, found {type(content).__name__}")
    return content


def versions() -> dict[str, str]:
    """Return the versions that decide a result."""
    found = {"python": platform.python_version()}
    for package in REPORTED_PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def source_commit(package: Path = Path(__file__).parent) -> str | None:
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
