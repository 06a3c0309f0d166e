"""The files of Gaussians of other programs, by suffix: the one list of what is read and written."""

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import Gaussians
from digs_warp.formats.splats.compressed_ply import write_compressed
from digs_warp.formats.splats.dot_splat import read_dot_splat, write_dot_splat
from digs_warp.formats.splats.gltf import read_gltf, write_gltf
from digs_warp.formats.splats.ply import read_ply, write_ply
from digs_warp.formats.splats.rows import (
    WORLD_FROM_UP,
    check_writable,
    near_origin,
    turned,
    without_broken_rows,
)
from digs_warp.formats.splats.sog import read_sog, write_sog
from digs_warp.formats.splats.spz import SH_BITS, read_spz, write_spz

logger = logging.getLogger(__name__)

UpAxis = Literal["z", "y", "-y"]


@dataclass(frozen=True)
class SplatWriting:
    """What the formats leave open.

    Attributes:
        up: the axis that is to point up where the format does not say it; "z" keeps the values.
        spz_sh_bits: see `digs_warp.formats.splats.spz.write_spz`.
        vertex_colors: for PLY, see `digs_warp.formats.splats.ply.write_ply`.
    """

    up: UpAxis = "z"
    spz_sh_bits: tuple[int, int] = SH_BITS
    vertex_colors: bool = False


AS_IT_IS = SplatWriting()


@dataclass(frozen=True)
class SplatFormat:
    """A format.

    Attributes:
        read: a file, as it is.
        write: a file; None: the format is only read.
        says_up: whether its axes are fixed: `read` and `write` turn them.
        keeps_offset: whether it holds places far from the origin.
        holds_none: whether it can say that there are 0 Gaussians.
    """

    read: Callable[[Path], Gaussians]
    write: Callable[[Path, Gaussians, SplatWriting], None] | None
    says_up: bool = False
    keeps_offset: bool = False
    holds_none: bool = True


FORMATS = {
    ".ply": SplatFormat(
        read_ply, lambda path, g, how: write_ply(path, g, how.vertex_colors), keeps_offset=True
    ),
    ".compressed.ply": SplatFormat(
        read_ply, lambda path, g, _: write_compressed(path, g), holds_none=False
    ),
    ".spz": SplatFormat(
        read_spz,
        lambda path, g, how: write_spz(path, g, how.spz_sh_bits),
        says_up=True,
    ),
    ".splat": SplatFormat(
        read_dot_splat, lambda path, g, _: write_dot_splat(path, g), holds_none=False
    ),
    ".sog": SplatFormat(read_sog, lambda path, g, _: write_sog(path, g), holds_none=False),
    ".glb": SplatFormat(
        read_gltf, lambda path, g, _: write_gltf(path, g), says_up=True, holds_none=False
    ),
    ".gltf": SplatFormat(read_gltf, None, says_up=True),
}
SUFFIXES = tuple(FORMATS)
CONVERTERS = "SuperSplat and splat-transform make PLY of other formats, such as .ksplat"
WRITABLE = tuple(suffix for suffix, form in FORMATS.items() if form.write)


def suffix_of(path: Path) -> str:
    """Return the suffix by which a format goes, in lower case."""
    name = path.name.lower()
    return ".compressed.ply" if name.endswith(".compressed.ply") else path.suffix.lower()


def read_splat_file(path: Path, up: UpAxis = "z", drop_broken: bool = False) -> Gaussians:
    """Read a file of one of `FORMATS` into our world (z up).

    Args:
        path: the file; its suffix decides.
        up: the axis that points up, where the format does not say it; with "z" the values are taken as they
            are.
        drop_broken: leave out Gaussians with NaN or infinite values instead of refusing the file.

    Raises:
        DigsError: missing, truncated, damaged, another format, or broken rows.
    """
    path = Path(path)
    form = _format_of(path, SUFFIXES)
    try:
        gaussians = form.read(path)
    except OSError as error:
        raise DigsError(f"'{path}': cannot be read ({error.strerror or error})") from error
    gaussians = without_broken_rows(gaussians, f"'{path}'", drop_broken)
    if gaussians.world_offset is None:
        means, offset = near_origin(gaussians.means, f"'{path}'")
        gaussians = replace(gaussians, means=means, world_offset=offset)
    return gaussians if up == "z" or form.says_up else turned(gaussians, WORLD_FROM_UP[up])


def write_splat_file(path: Path, gaussians: Gaussians, how: SplatWriting = AS_IT_IS) -> None:
    """Write a file of one of `FORMATS`; it appears only when complete, and replaces an older one only then.

    Args:
        path: the file; its suffix decides.
        gaussians: in our world (z up).
        how: what the formats leave open.

    Raises:
        DigsError: another suffix, values that are not finite or that the format cannot hold, or the file
            cannot be written (the message says why: disk full, read-only, ...).
    """
    path = Path(path)
    form = _format_of(path, WRITABLE)
    check_writable(gaussians, f"'{path}'")
    if not len(gaussians) and not form.holds_none:
        raise DigsError(f"'{path}': the format cannot hold 0 Gaussians; write PLY or SPZ instead")
    if gaussians.world_offset is not None and not form.keeps_offset:
        logger.warning(
            "'%s': the format cannot hold places so far from the origin; centers are written less %s m; PLY, "
            "USD and .npz keep them",
            *(path, list(gaussians.world_offset)),
        )
    if how.up != "z" and not form.says_up:
        gaussians = turned(gaussians, WORLD_FROM_UP[how.up].T)
    assert form.write is not None
    form.write(path, gaussians, how)


def _format_of(path: Path, suffixes: tuple[str, ...]) -> SplatFormat:
    suffix = suffix_of(path)
    if suffix not in suffixes:
        raise DigsError(
            f"'{path}': suffix '{suffix}', expected one of {', '.join(suffixes)}; {CONVERTERS}"
        )
    return FORMATS[suffix]
