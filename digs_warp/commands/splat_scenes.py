"""Gaussians of any kind of source, and into any kind of file: what `convert`, `render` and `mesh` share."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

from digs_warp.checks import DigsError, require_file
from digs_warp.record.layout import GAUSSIANS, find_gaussians

if TYPE_CHECKING:
    from digs_warp.data.gaussians import Gaussians

OURS = ".npz"
SPLAT_SUFFIXES = (".ply", ".spz", ".splat")
USD_SUFFIXES = (".usdz", ".usdc", ".usda")
SUFFIXES = (OURS, *SPLAT_SUFFIXES, *USD_SUFFIXES)


@dataclass(frozen=True, kw_only=True)
class SplatOptions:
    """What splat files do not say themselves."""

    up: Literal["z", "y", "-y"] = "z"
    """The axis that points up in PLY and .splat files, which do not say it. z: as this program writes
    them; -y: most scenes that other programs trained; y: Y-up programs. SPZ and USD need no telling."""

    drop_broken: tyro.conf.FlagCreatePairsOff[bool] = False
    """Leave out Gaussians with NaN or infinite values instead of refusing a PLY, SPZ or .splat file."""


def read_splats(source: Path, options: SplatOptions) -> "Gaussians":
    """Return the Gaussians of a reconstruction folder, an ``.npz``, a splat file or a USD scene.

    Raises:
        DigsError: the source is missing, damaged or none of these.
    """
    from digs_warp.data.gaussians import Gaussians

    path = find_gaussians(source)
    suffix = path.suffix.lower()
    if suffix in SPLAT_SUFFIXES:
        from digs_warp.interchange.splats.files import read_splat_file

        return read_splat_file(path, options.up, options.drop_broken)
    if suffix in (*USD_SUFFIXES, ".usd"):
        from digs_warp.usd.reader import read_gaussians

        return read_gaussians(path)
    require_file(path, "Gaussians")
    if suffix != OURS:
        raise DigsError(
            f"'{path}': suffix '{path.suffix}', expected Gaussians: a folder of 'digs-warp reconstruct', "
            f"or one of {', '.join(SUFFIXES)}"
        )
    return Gaussians.load(path)


def check_splat_target(target: Path) -> None:
    """Raise a `DigsError` unless the suffix of ``target`` is one that `write_splats` knows."""
    if target.suffix.lower() not in SUFFIXES:
        raise DigsError(
            f"'{target}': suffix '{target.suffix}', expected one of {', '.join(SUFFIXES)} for Gaussians"
        )


def write_splats(
    target: Path, gaussians: "Gaussians", source: Path, options: SplatOptions, spz_version: int
) -> None:
    """Write Gaussians in the format that the suffix of ``target`` names.

    ``source`` is where they come from: a USD scene takes along what lies beside a reconstruction.
    """
    suffix = target.suffix.lower()
    if suffix in SPLAT_SUFFIXES:
        from digs_warp.interchange.splats.files import write_splat_file

        write_splat_file(target, gaussians, options.up, spz_version)
    elif suffix in USD_SUFFIXES:
        _write_usd(target, gaussians, find_gaussians(source))
    else:
        gaussians.save(target)


def _write_usd(target: Path, gaussians: "Gaussians", source: Path) -> None:
    """Write a USD scene; only a reconstruction's own file is told how it was made."""
    if source.name == GAUSSIANS:
        from digs_warp.commands.export_usd import write_scene

        write_scene(gaussians, source.parent, target)
    else:
        from digs_warp.usd.writer import write_gaussians

        write_gaussians(target, gaussians, {"source": source.name})
