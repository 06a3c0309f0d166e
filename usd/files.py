"""USD files on disk: opened with readable errors, written completely or not at all."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from digs_warp.checks import DigsError, UsdError, require_file
from digs_warp.record.disk import out_of_space
from digs_warp.record.files import new_file
from digs_warp.usd import names
from digs_warp.usd.package import PackageWriter
from digs_warp.usd.structure import check_structure, open_layers

if TYPE_CHECKING:
    from pxr import Sdf, Usd

HINT = "Expected a .usda, .usdc or .usdz scene, as 'digs-warp export-usd' writes it."

# A few bytes of a broken file may promise billions of values, and the USD library allocates before it looks.
# Under a limit, that fails at once. Reading may take this much beyond what the process has (for the library
# and its threads), and this much per byte of the file (for all arrays and their copies).
HEADROOM = 512 << 20
PER_BYTE = 24

_lock = threading.Lock()


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
    except UnicodeEncodeError as error:
        raise _unnamable(path) from error
    except TypeError as error:
        if "No to_python" not in str(error):
            raise
        raise UsdError(
            f"USD scene '{path}': a value has a type that scenes do not have; the file is broken."
        ) from error
    except MemoryError as error:
        raise UsdError(
            f"USD scene '{path}': claims far more values than its {size} bytes can hold; the file is broken."
        ) from error


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
        writer = PackageWriter(package, path)
        for member in sorted(
            folder.iterdir(), key=lambda each: (each.name != names.PACKAGE_ROOT, each.name)
        ):
            writer.add(member, member.name)
        writer.close()


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


@contextmanager
def limited_memory(file_size: int) -> Iterator[None]:
    """Limit the data of this process while the block reads a file of ``file_size`` bytes.

    The limit is the process's own (RLIMIT_DATA), so it also holds for other threads during the block;
    where a second thread reads at the same time, or the system has no such limit, nothing is limited.
    """
    try:
        import resource

        used = _data_bytes()
    except (ImportError, OSError):
        yield
        return
    if not _lock.acquire(blocking=False):
        yield
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    limit = used + HEADROOM + PER_BYTE * file_size
    tighter = [limit, *(bound for bound in (soft, hard) if bound != resource.RLIM_INFINITY)]
    try:
        resource.setrlimit(resource.RLIMIT_DATA, (min(tighter), hard))
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
        _lock.release()


def _data_bytes() -> int:
    """Return the size of the private, writable memory of this process (Linux)."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmData:")[1].split()[0]) * 1024
