# pxr comes without type stubs:
# pyright: reportAttributeAccessIssue=false
"""USD files on disk: open one with a readable error, write one so that it is complete or not there."""

import os
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from digs_warp.checks import DigsError, UsdError, require_file
from usd import names

if TYPE_CHECKING:
    from pxr import Sdf, Usd

HINT = "Expected a .usda, .usdc or .usdz scene, as 'digs-warp export-usd' writes it."

# A usdz package is a ZIP file without the 64-bit extension.
MAX_PACKAGE_MEMBER = 2**32 - 1

# The oldest local time that a ZIP file can hold. Packages carry the time of their members; with the
# true one, the same scene would give different bytes every two seconds.
_PACKAGE_TIME = (1980, 1, 1, 0, 0, 0, 0, 1, -1)


def open_stage(path: Path) -> "Usd.Stage":
    """Open a scene, or raise a `UsdError` that names the file and what is wrong with it."""
    from pxr import Tf, Usd

    try:
        require_file(path, "USD scene", HINT)
    except DigsError as error:
        raise UsdError(str(error)) from None
    try:
        return Usd.Stage.Open(os.path.abspath(path))
    except Tf.ErrorException as error:
        raise UsdError(
            f"USD scene '{path}': truncated or not a USD file ({_reason(error)}). {HINT}"
        ) from error


def check_suffix(path: Path) -> None:
    """Raise a `UsdError` unless the suffix is one that we write."""
    if path.suffix.lower() not in names.SUFFIXES:
        raise UsdError(
            f"USD scene '{path}': suffix '{path.suffix}', expected one of {', '.join(names.SUFFIXES)}"
        )


def save_layer(layer: "Sdf.Layer", path: Path) -> None:
    """Write a layer in the format that the suffix of ``path`` names.

    All work happens in a temporary folder beside ``path``; its result is renamed. Whatever lies under
    other names stays as it is, and an old file stays when the new one fails.

    Raises:
        UsdError: the file cannot be written, or does not fit into a package.
    """
    from pxr import Tf

    suffix = path.suffix.lower()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as folder:
            finished = Path(folder) / f"scene{suffix}"
            scene = Path(folder) / names.PACKAGE_ROOT if suffix == ".usdz" else finished
            if not layer.Export(str(scene)):
                raise UsdError(f"USD scene '{path}': cannot be written. Is the disk full?")
            if suffix == ".usdz":
                _package(scene, finished, path)
            os.replace(finished, path)
    except OSError as error:
        raise UsdError(f"USD scene '{path}': cannot be written ({error})") from error
    except Tf.ErrorException as error:
        raise UsdError(
            f"USD scene '{path}': cannot be written ({_reason(error)}). Is the disk full?"
        ) from error


def check_package_size(size: int, path: Path) -> None:
    """Raise a `UsdError` when a member of ``size`` bytes does not fit into a usdz package."""
    if size > MAX_PACKAGE_MEMBER:
        raise UsdError(
            f"USD scene '{path}': {size} bytes do not fit into a usdz package (below 4 GiB); "
            "write a .usdc file instead"
        )


def _package(scene: Path, package: Path, path: Path) -> None:
    from pxr import UsdUtils

    check_package_size(scene.stat().st_size, path)
    stamp = time.mktime(_PACKAGE_TIME)
    os.utime(scene, (stamp, stamp))
    # The resolver's packager aligns members to 64 bytes and stores them uncompressed, as usdz demands.
    if not UsdUtils.CreateNewUsdzPackage(str(scene), str(package), names.PACKAGE_ROOT):
        raise UsdError(f"USD scene '{path}': the package cannot be written. Is the disk full?")


def _reason(error: Exception) -> str:
    """Return the first line of what USD says, without the place in its own source."""
    first = str(error).strip().splitlines()[0]
    return first.rsplit(" : ", 1)[-1].strip(" '")
