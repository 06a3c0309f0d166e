"""The one way to write a file, and text and JSON as files."""

import hashlib
import json
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.bounds import JSON, SETTINGS, TEXT, Bound
from digs_warp.checks import DigsError, require_regular
from digs_warp.record.disk import append, put, rename, reported, sync, temporary_beside
from digs_warp.record.fields import parse_json
from digs_warp.record.manifest import manifest_of

# A number with an exponent, as other programs and Python write it. Longer exponents are no number's.
_EXPONENT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d{1,3}$")


def write_atomically(path: Path, data: bytes) -> None:
    """Write ``data``: complete, synced to the disk and under its name, or not at all.

    Every write of the package ends here or in `new_file`. Where the manifest of a folder is being written
    (`digs_warp.record.manifest.recorded_files`), it lists the file.

    Raises:
        DigsError: the disk is full, or the file cannot be written; names the path, the space needed and the
            space free. A file that was there before is unchanged.
    """
    path = Path(path)
    with reported(path, len(data)):
        claim(path)
        put(path, data)


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """Yield a temporary name for a library that writes by name; after the block the file is at ``path``.

    The name is in a temporary folder beside ``path``, with its suffix in lower case; other files in it are
    deleted. Libraries report success for truncated files: a block has to check what it wrote,
    and raise `digs_warp.record.disk.out_of_space` if the file is not complete.

    Raises:
        DigsError: as `write_atomically` does.
    """
    path = Path(path)
    folder = temporary_beside(path)
    unfinished = folder / (path.stem + path.suffix.lower())
    try:
        with reported(path):
            folder.mkdir(parents=True, exist_ok=True)
            yield unfinished
            sync(unfinished)
            claim(path)
            rename(unfinished, path)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def add_line(path: Path, line: str) -> None:
    """Append a line to a file, whole and synced or not at all; see `write_atomically` for what it raises.

    Manifests do not list files that grow.
    """
    data = line.encode() + b"\n"
    with reported(path, len(data)):
        append(path, data)
        sync(path)


def copy_file(source: Path, path: Path) -> None:
    """Copy a file; see `write_atomically`."""
    write_atomically(path, Path(source).read_bytes())


def copy_folder(source: Path, folder: Path) -> None:
    """Copy all files below ``source``; see `write_atomically`."""
    for path in sorted(source.rglob("*")):
        if path.is_file():
            copy_file(path, folder / path.relative_to(source))


def remove(path: Path) -> None:
    """Delete a file of ours, if it is there, and take it off the manifest that lists it."""
    manifest = manifest_of(path)
    if manifest is not None:
        manifest.forget(path)
    if path.exists():
        sync(path.parent)  # what follows it, such as Gaussians a checkpoint, has its name for good
        path.unlink()


def remove_folder(folder: Path) -> None:
    """Delete a folder of ours, if it is there; see `remove`."""
    for path in folder.rglob("*"):
        if path.is_file():
            remove(path)
    shutil.rmtree(folder, ignore_errors=True)


def claim(path: Path) -> None:
    """List a file that is about to appear, also one that a library makes and changes, such as a database."""
    manifest = manifest_of(path)
    if manifest is not None:
        manifest.add(path)


def to_json(value: Any) -> str:
    """Return readable JSON of dataclasses, paths, NumPy scalars and arrays.

    Raises:
        DigsError: a number is infinite or NaN.
    """
    try:
        return json.dumps(value, indent=2, default=_plain, allow_nan=False) + "\n"
    except ValueError as error:
        raise DigsError(
            f"JSON holds finite numbers only ({error}); look for extreme positions or sizes in the input"
        ) from error


def _plain(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"cannot write {type(value).__name__} as JSON")


def read_text(path: Path, what: str, bound: Bound = TEXT, errors: str = "strict") -> str:
    """Return the content of a text file in UTF-8, without a mark of its byte order; ``errors`` as in `open`.

    Raises:
        DigsError: missing, not readable, not UTF-8, or larger than ``bound``.
    """
    path = Path(path)
    with _explained(path, what):
        bound.check(f"{what} '{path}'", path.stat().st_size)
        return path.read_text(encoding="utf-8-sig", errors=errors)


def text_lines(path: Path, what: str) -> Iterator[str]:
    """Yield the lines of a text file in UTF-8 of any size, one in memory at a time.

    Raises:
        DigsError: missing, not readable or not UTF-8.
    """
    path = Path(path)
    with _explained(path, what), path.open(encoding="utf-8-sig") as file:
        yield from file


@contextmanager
def _explained(path: Path, what: str) -> Iterator[None]:
    """Raise a `DigsError` where a text file cannot be read."""
    try:
        require_regular(path, what)
        yield
    except FileNotFoundError:
        raise DigsError(f"{what} '{path}': no such file") from None
    except OSError as error:
        raise DigsError(f"{what} '{path}': cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise DigsError(f"{what} '{path}': not UTF-8 ({error}); write it again") from error


def read_json(path: Path, what: str) -> dict[str, Any]:
    """Return a JSON object, or raise a `DigsError` that says where the file is broken."""
    text = read_text(path, what, JSON)
    try:
        content = parse_json(text)
    except ValueError as error:
        raise DigsError(f"{what} '{path}': not valid JSON ({error}); write it again") from error
    if not isinstance(content, dict):
        raise DigsError(f"{what} '{path}': expected a JSON object, found {type(content).__name__}")
    return content


@cache
def _yaml_loader() -> Any:
    """Return PyYAML's safe loader, which then takes 2e-05 for a number, too: it wants a point and a sign."""
    import yaml

    class Loader(yaml.SafeLoader):
        pass

    Loader.add_implicit_resolver("tag:yaml.org,2002:float", _EXPONENT, [*"+-.0123456789"])
    return Loader


def read_yaml(path: Path, what: str) -> dict[str, Any]:
    """Return a YAML mapping; OpenCV's head, ``%YAML:1.0``, which is no YAML, is skipped.

    Raises:
        DigsError: missing, too large, not YAML, no mapping, or nested too deeply.
    """
    import yaml

    text = read_text(path, what, SETTINGS)
    try:
        content = yaml.load(re.sub(r"\A%YAML:.*", "", text), _yaml_loader())
    except Exception as error:  # the parser's own, and many kinds for values that it cannot make
        reason = " ".join(str(error).split())
        raise DigsError(f"{what} '{path}': not readable as YAML ({reason})") from error
    if not isinstance(content, dict):
        raise DigsError(f"{what} '{path}': expected a mapping, found {type(content).__name__}")
    return content


def plain(value: Any) -> Any:
    """Return a value of dataclasses, paths and NumPy scalars as JSON stores it."""
    return json.loads(to_json(value))


def digest(value: Any) -> str:
    """Return 16 hexadecimal digits that identify a JSON-like value; the order of keys does not matter."""
    text = json.dumps(plain(value), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
