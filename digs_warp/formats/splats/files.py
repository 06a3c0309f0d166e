"""Splat files by suffix: one function to read and one to write PLY, SPZ and .splat."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import Gaussians
from digs_warp.formats.splats.dot_splat import read_dot_splat, write_dot_splat
from digs_warp.formats.splats.ply import read_ply, write_ply
from digs_warp.formats.splats.rows import (
    WORLD_FROM_UP,
    check_writable,
    near_origin,
    turned,
    without_broken_rows,
)
from digs_warp.formats.splats.spz import DEFAULT_VERSION, read_spz, write_spz

SUFFIXES = (".ply", ".spz", ".splat")

UpAxis = Literal["z", "y", "-y"]


def read_splat_file(path: Path, up: UpAxis = "z", drop_broken: bool = False) -> Gaussians:
    """Read a PLY, SPZ or .splat file into our world (z up).

    Args:
        path: the file; its suffix decides.
        up: the axis of a PLY or .splat file that points up, which these formats do not say; with "z" the
            values are taken as they are. SPZ says it: y.
        drop_broken: leave out Gaussians with NaN or infinite values instead of refusing the file.

    Raises:
        DigsError: missing, truncated, damaged, another format, or broken rows.
    """
    path = Path(path)
    readers = {".ply": read_ply, ".spz": read_spz, ".splat": read_dot_splat}
    suffix = _checked_suffix(path)
    try:
        gaussians = readers[suffix](path)
    except OSError as error:
        raise DigsError(f"'{path}': cannot be read ({error.strerror or error})") from error
    gaussians = without_broken_rows(gaussians, f"'{path}'", drop_broken)
    if suffix != ".ply":
        means, offset = near_origin(gaussians.means, f"'{path}'")
        gaussians = replace(gaussians, means=means, world_offset=offset)
    return gaussians if up == "z" or suffix == ".spz" else turned(gaussians, WORLD_FROM_UP[up])


def write_splat_file(
    path: Path,
    gaussians: Gaussians,
    up: UpAxis = "z",
    spz_version: int = DEFAULT_VERSION,
    vertex_colors: bool = False,
) -> None:
    """Write a PLY, SPZ or .splat file; it appears only when complete, and replaces an older one only then.

    Args:
        path: the file; its suffix decides.
        gaussians: in our world (z up).
        up: the axis that is to point up in a PLY or .splat file; "z" keeps the values as they are.
        spz_version: 2, 3 or 4, see `digs_warp.formats.splats.spz.write_spz`.
        vertex_colors: for PLY, see `digs_warp.formats.splats.ply.write_ply`.

    Raises:
        DigsError: another suffix, values that are not finite or that the format cannot hold, or the file
            cannot be written (the message says why: disk full, read-only, ...).
    """
    path = Path(path)
    suffix = _checked_suffix(path)
    check_writable(gaussians, f"'{path}'")
    if up != "z" and suffix != ".spz":
        gaussians = turned(gaussians, WORLD_FROM_UP[up].T)
    if suffix == ".spz":
        write_spz(path, gaussians, spz_version)
    elif suffix == ".ply":
        write_ply(path, gaussians, vertex_colors)
    else:
        write_dot_splat(path, gaussians)


def _checked_suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise DigsError(f"'{path}': suffix '{path.suffix}', expected one of {', '.join(SUFFIXES)}")
    return suffix
