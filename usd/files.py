"""USD files on disk: open one with a readable error, write one so that it is complete or not there."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from digs_warp.checks import DigsError, UsdError, require_file
from digs_warp.usd import names
from digs_warp.usd.memory_guard import limited_memory
from digs_warp.usd.package_writer import PackageWriter
from digs_warp.usd.structure import check_structure, open_layers

if TYPE_CHECKING:
    from pxr import Sdf, Usd

HINT = "Expected a .usda, .usdc or .usdz scene, as 'digs-warp export-usd' writes it."


@contextmanager
def opened_stage(path: Path) -> Iterator["Usd.Stage"]:
    """Open a scene for the block.

    Files may come from anywhere: what USD finds broken in the block, at once or when a value is
    fetched, becomes a `UsdError` that names the file, and memory is limited by the size of the file.
    """
    from pxr import Tf, Usd

    try:
        size = require_file(path, "USD scene", HINT).stat().st_size
    except DigsError as error:
        raise UsdError(str(error)) from None
    try:
        with limited_memory(size):
            check_structure(path)
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


@contextmanager
def package_folder(path: Path) -> Iterator[Path]:
    """Give a folder for layers; at the end all of them become a package, with ``default.usdc`` first.

    Raises:
        UsdError: the file cannot be written, or the layers do not fit into a package.
    """
    with finished_file(path) as package:
        folder = package.parent / "layers"
        folder.mkdir()
        yield folder
        writer = PackageWriter(package, path)
        for member in sorted(
            folder.iterdir(), key=lambda each: (each.name != names.PACKAGE_ROOT, each.name)
        ):
            writer.add(member, member.name)
        writer.close()


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


def reason(error: Exception) -> str:
    """Return the first line of what USD says, without the place in its own source."""
    try:
        first = str(error).strip().splitlines()[0]
    except UnicodeDecodeError:  # USD quotes the broken bytes
        return "text in it is not UTF-8"
    return first.rsplit(" : ", 1)[-1].strip(" '")
