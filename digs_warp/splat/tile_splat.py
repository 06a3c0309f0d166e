# type: ignore
# (device code, which Warp's stubs do not type)
"""A splat as both passes over a tile see it: its record, counted from the tile, and its fall-off."""

import warp as wp

from digs_warp.splat.records import (
    SPLAT_A,
    SPLAT_B,
    SPLAT_BLUE,
    SPLAT_C,
    SPLAT_GREEN,
    SPLAT_OPACITY,
    SPLAT_RED,
    SPLAT_V,
)
from digs_warp.splat.tile import BLOCK_COLUMNS, BLOCK_LINES, BLOCK_ROW_MASK, BLOCK_ROW_SHIFT

wp.set_module_options({"enable_backward": False})


@wp.struct
class TileSplat:
    """What compositing reads of a splat; its centre [px] is counted from that of the tile's first pixel."""

    mean_x: float
    mean_y: float
    a: float  # conic
    b: float
    c: float
    a_half: float  # -a / 2 and -c / 2
    c_half: float
    opacity: float
    red: float
    green: float
    blue: float


@wp.func
def tile_splat(splats: wp.array2d[float], g: int, mean_x: float, tile_y: int) -> TileSplat:
    """Splat g in a tile that begins in row tile_y; ``mean_x`` is its centre, counted from the tile."""
    splat = TileSplat()
    splat.mean_x = mean_x
    splat.mean_y = splats[g, SPLAT_V] - float(tile_y) - 0.5
    splat.a = splats[g, SPLAT_A]
    splat.b = splats[g, SPLAT_B]
    splat.c = splats[g, SPLAT_C]
    splat.a_half = -0.5 * splat.a
    splat.c_half = -0.5 * splat.c
    splat.opacity = splats[g, SPLAT_OPACITY]
    splat.red = splats[g, SPLAT_RED]
    splat.green = splats[g, SPLAT_GREEN]
    splat.blue = splats[g, SPLAT_BLUE]
    return splat


@wp.func
def block_left(block: int, splat: TileSplat) -> float:
    """Offset [px] of the first column of a block from the centre of a splat."""
    return float((block >> BLOCK_ROW_SHIFT) * BLOCK_COLUMNS) - splat.mean_x


@wp.func
def block_top(block: int, splat: TileSplat) -> float:
    """Offset [px] of the first row of a block from the centre of a splat."""
    return float((block & BLOCK_ROW_MASK) * BLOCK_LINES) - splat.mean_y


@wp.func
def power_at(splat: TileSplat, dx: float, dy: float) -> float:
    """-q / 2 at an offset [px] from the centre."""
    return wp.min(dx * (splat.a_half * dx) + dy * (splat.c_half * dy - splat.b * dx), 0.0)
