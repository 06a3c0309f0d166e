"""USD files on disk: opened with readable errors, written completely or not at all."""

import os
import shutil
import signal
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from digs_warp.checks import DigsError, UsdError, require_file
from digs_warp.record.disk import out_of_space
from digs_warp.record.files import new_file
from digs_warp.usd import names, walk

if TYPE_CHECKING:
    from pxr import Sdf, Usd

HINT = "Expected a .usda, .usdc or .usdz scene, as 'digs-warp export-usd' writes it."

# Members of a package begin at multiples of this; the padding is an extra field of ZIP with its own header.
_ALIGNMENT, _PADDING_KIND, _PADDING_HEADER = 64, b"\x86\x19", 4
_LOCAL_HEADER = 30  # bytes before a member's name
# What zipfile writes without the 64-bit extension, which packages do not have; with room for headers.
MAX_PACKAGE = zipfile.ZIP64_LIMIT - 2**20

# Versions of files that this process wrote, or that were tried: device, number, size, time.
_sound: set[tuple[int, ...]] = set()


@contextmanager
def opened_stage(path: Path) -> Iterator["Usd.Stage"]:
    """Open a scene for the block.

    Files may come from anywhere: what crashes OpenUSD does so in a process of its own, and what USD finds
    broken in the block, at once or when a value is fetched, becomes a `UsdError` that names the file.
    """
    from pxr import Tf, Usd

    try:
        require_file(path, "USD scene", HINT)
    except DigsError as error:
        raise UsdError(str(error)) from None
    try:
        _try_apart(path)
        yield Usd.Stage.Open(os.path.abspath(path))
    except Tf.ErrorException as error:
        raise UsdError(
            f"USD scene '{path}': truncated or not a USD file ({reason(error)}). {HINT}"
        ) from error
    except UnicodeDecodeError as error:
        raise UsdError(
            f"USD scene '{path}': text in it is not UTF-8 ({error.reason}). Export it again."
        ) from error
    except UnicodeEncodeError as error:
        raise _unnamable(path) from error
    except TypeError as error:
        if "No to_python" not in str(error):
            raise
        raise UsdError(
            f"USD scene '{path}': a value has a type that scenes do not have; the file is broken."
        ) from error


def _try_apart(path: Path) -> None:
    """Open a file in another process first, unless it is known; see `digs_warp.usd.walk`.

    Raises:
        UsdError: the file ended the process.
    """
    if _version_of(path) in _sound:
        return
    size = path.stat().st_size
    limit = walk.seconds_for(size)
    command = [sys.executable, "-P", "-m", walk.__name__, os.path.abspath(path), str(size)]
    found = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    quiet = subprocess.DEVNULL
    late = f"keeps OpenUSD busy for more than {limit} s"
    try:
        # The limit is of the processor, and the file may be on a slow disk.
        code = subprocess.run(
            command, env=found, stdout=quiet, stderr=quiet, timeout=20 * limit, check=False
        ).returncode
        ends = {walk.OUT_OF_MEMORY: f"wants far more memory than its {size} bytes can need"}
        if code < 0:
            end = signal.Signals(-code).name
            ends[code] = late if end == "SIGXCPU" else f"ends OpenUSD with {end}"
    except subprocess.TimeoutExpired:
        code, ends = 0, {0: late}
    if code in ends:
        raise UsdError(
            f"USD scene '{path}': {ends[code]}, tried in a process of its own; the file is broken. Copy or "
            "export it again."
        )
    _sound.add(_version_of(path))


def _version_of(path: Path) -> tuple[int, ...]:
    found = path.stat()
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns


def check_suffix(path: Path) -> None:
    """Raise a `UsdError` unless the suffix is one that we write."""
    if path.suffix.lower() not in names.SUFFIXES:
        raise UsdError(
            f"USD scene '{path}': suffix '{path.suffix}', expected one of {', '.join(names.SUFFIXES)}"
        )


@contextmanager
def package_folder(path: Path) -> Iterator[Path]:
    """Give a folder for layers; at the end they become a package, with ``default.usdc`` first.

    Raises:
        UsdError: the file cannot be written, or the layers do not fit into a package.
    """
    with finished_file(path) as package:
        folder = package.parent / "layers"
        folder.mkdir()
        yield folder
        members = sorted(
            folder.iterdir(), key=lambda each: (each.name != names.PACKAGE_ROOT, each.name)
        )
        write_package(package, members, path)


def write_package(package: Path, members: list[Path], shown_path: Path) -> None:
    """Put files into a package, uncompressed, aligned, of the first date of ZIP: same input, same bytes.

    Raises:
        UsdError: they do not fit; names ``shown_path``.
    """
    total = sum(member.stat().st_size for member in members)
    if total > MAX_PACKAGE:
        raise UsdError(
            f"USD scene '{shown_path}': {total} bytes do not fit into a usdz package (below 2 GiB); store "
            "fewer splats, half precision or a lower degree, or write a .usdc file"
        )
    at = 0
    with zipfile.ZipFile(package, "w", allowZip64=False) as archive:
        for member in members:
            entry = zipfile.ZipInfo(member.name)
            start = at + _LOCAL_HEADER + len(member.name.encode()) + _PADDING_HEADER
            padding = -start % _ALIGNMENT
            entry.extra = _PADDING_KIND + padding.to_bytes(2, "little") + bytes(padding)
            with archive.open(entry, "w") as target, member.open("rb") as source:
                shutil.copyfileobj(source, target, 1 << 20)
            at = start + padding + member.stat().st_size


@contextmanager
def finished_file(path: Path) -> Iterator[Path]:
    """Give the temporary name for writing the file that becomes ``path``; see `new_file`.

    OpenUSD reports failed writes.

    Raises:
        UsdError: the file cannot be written.
    """
    from pxr import Tf

    try:
        with new_file(path) as unfinished:
            yield unfinished
        _sound.add(_version_of(path))
    except UsdError:
        raise
    except DigsError as error:
        raise UsdError(f"USD scene {error}") from error
    except UnicodeEncodeError as error:
        raise _unnamable(path) from error
    except Tf.ErrorException as error:
        raise UsdError(f"USD scene {out_of_space(path, reason(error))}") from error


def _unnamable(path: Path) -> UsdError:
    return UsdError(
        f"USD scene '{path}': OpenUSD opens only files with names in UTF-8; rename it, or its folder"
    )


def export_layer(layer: "Sdf.Layer", target: Path, path: Path) -> None:
    """Write a layer to ``target``, or raise a `UsdError` that names the scene at ``path``."""
    if not layer.Export(str(target)):
        raise UsdError(f"USD scene {out_of_space(path, 'OpenUSD gave up')}")


def reason(error: Exception) -> str:
    """Return the first line of a message of USD, without the place in USD's source."""
    try:
        first = str(error).strip().splitlines()[0]
    except UnicodeDecodeError:  # USD quotes the broken bytes
        return "text in it is not UTF-8"
    return first.rsplit(" : ", 1)[-1].strip(" '")
