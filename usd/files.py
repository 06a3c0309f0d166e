# pxr comes without type stubs:
# pyright: reportAttributeAccessIssue=false
"""USD files on disk: open one with a readable error, write one so that it is complete or not there."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from digs_warp.checks import DigsError, UsdError, require_file
from usd import names
from usd.memory_guard import limited_memory
from usd.structure import check_structure, open_layers

if TYPE_CHECKING:
    from pxr import Sdf, Usd

HINT = "Expected a .usda, .usdc or .usdz scene, as 'digs-warp export-usd' writes it."

# A usdz package is a ZIP file without the 64-bit extension: offsets have 32 bits. Some of that is for the
# headers and the alignment of members.
MAX_PACKAGE = 2**32 - 2**16

# The oldest local time that a ZIP file can hold. Packages carry the time of their members; with the
# true one, the same scene would give different bytes every two seconds.
_PACKAGE_TIME = (1980, 1, 1, 0, 0, 0, 0, 1, -1)


@contextmanager
def opened_stage(path: Path) -> Iterator["Usd.Stage"]:
    """Open a scene for the block.

    Files may come from anywhere: what USD finds broken in the block, at once or when a value is
    fetched, becomes a `UsdError` that names the file, and memory is limited by the size of the file.
    """
    from pxr import Tf, Usd

    try:
        size = require_file(path, "USD scene", HINT).stat().st_size
        check_structure(path)
    except DigsError as error:
        raise UsdError(str(error)) from None
    try:
        with limited_memory(size):
            layers = open_layers(path)
            stage = Usd.Stage.Open(os.path.abspath(path))
            del layers
            yield stage
    except Tf.ErrorException as error:
        raise UsdError(
            f"USD scene '{path}': truncated or not a USD file ({reason(error)}). {HINT}"
        ) from error
    except UnicodeDecodeError as error:
        raise UsdError(
            f"USD scene '{path}': text in it is not UTF-8 ({error.reason}). Export it again."
        ) from error
    except TypeError as error:
        if "No to_python" not in str(error):
            raise
        raise UsdError(
            f"USD scene '{path}': a value of a type that has no place in a scene; the file is broken."
        ) from error
    except MemoryError as error:
        raise UsdError(
            f"USD scene '{path}': promises far more values than its {size} bytes hold; it is broken."
        ) from error


def check_suffix(path: Path) -> None:
    """Raise a `UsdError` unless the suffix is one that we write."""
    if path.suffix.lower() not in names.SUFFIXES:
        raise UsdError(
            f"USD scene '{path}': suffix '{path.suffix}', expected one of {', '.join(names.SUFFIXES)}"
        )


def save_layer(layer: "Sdf.Layer", path: Path) -> None:
    """Write a layer in the format that the suffix of ``path`` names; see `finished_file`.

    Raises:
        UsdError: the file cannot be written, or does not fit into a package.
    """
    if path.suffix.lower() == ".usdz":
        with package_folder(path) as folder:
            export_layer(layer, folder / names.PACKAGE_ROOT, path)
    else:
        with finished_file(path) as unfinished:
            export_layer(layer, unfinished, path)


@contextmanager
def package_folder(path: Path) -> Iterator[Path]:
    """Give a folder for layers; at the end, ``default.usdc`` and all it refers to become a package.

    Raises:
        UsdError: the file cannot be written, or the layers do not fit into a package.
    """
    with finished_file(path) as package:
        folder = package.parent / "layers"
        folder.mkdir()
        yield folder
        _package(folder, package, path)


@contextmanager
def finished_file(path: Path) -> Iterator[Path]:
    """Give the name under which to write the file that shall become ``path``.

    It lies in a temporary folder beside ``path`` and is renamed at the end. Whatever lies under other
    names stays as it is, and an old file stays when the new one fails.

    Raises:
        UsdError: the file cannot be written.
    """
    from pxr import Tf

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as folder:
            unfinished = Path(folder) / f"scene{path.suffix.lower()}"
            yield unfinished
            os.replace(unfinished, path)
    except OSError as error:
        raise UsdError(f"USD scene '{path}': cannot be written ({error})") from error
    except Tf.ErrorException as error:
        raise UsdError(
            f"USD scene '{path}': cannot be written ({reason(error)}). Is the disk full?"
        ) from error


def export_layer(layer: "Sdf.Layer", target: Path, path: Path) -> None:
    """Write a layer to ``target``, on the way to the scene at ``path``, or raise a `UsdError`."""
    if not layer.Export(str(target)):
        raise UsdError(f"USD scene '{path}': cannot be written. Is the disk full?")


def check_package_size(size: int, path: Path) -> None:
    """Raise a `UsdError` when layers of ``size`` bytes do not fit into a usdz package."""
    if size > MAX_PACKAGE:
        raise UsdError(
            f"USD scene '{path}': {size} bytes do not fit into a usdz package (below 4 GiB); store fewer "
            "splats, half precision or a lower degree, or write a .usdc file"
        )


def _package(folder: Path, package: Path, path: Path) -> None:
    from pxr import UsdUtils

    members = sorted(folder.iterdir())
    check_package_size(sum(member.stat().st_size for member in members), path)
    stamp = time.mktime(_PACKAGE_TIME)
    for member in members:
        os.utime(member, (stamp, stamp))
    # The resolver's packager aligns members to 64 bytes and stores them uncompressed, as usdz demands.
    root = str(folder / names.PACKAGE_ROOT)
    if not UsdUtils.CreateNewUsdzPackage(root, str(package), names.PACKAGE_ROOT):
        raise UsdError(f"USD scene '{path}': the package cannot be written. Is the disk full?")


def reason(error: Exception) -> str:
    """Return the first line of what USD says, without the place in its own source."""
    try:
        first = str(error).strip().splitlines()[0]
    except UnicodeDecodeError:  # USD quotes the broken bytes
        return "text in it is not UTF-8"
    return first.rsplit(" : ", 1)[-1].strip(" '")
