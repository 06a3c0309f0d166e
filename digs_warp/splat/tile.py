"""What both passes over a tile share: memory, alpha, the blocks that a splat touches, and output.

The pixels of a tile lie in blocks of 2 rows by 8 columns, first those of the left half from top to bottom,
then those of the right half. A splat is evaluated block by block: 16 values are one vector of AVX-512, or two
of AVX2 that hide each other's latency, and a small splat touches few blocks.

A plane holds one value of every pixel. The planes of a tile lie one after the other in memory of the thread,
on a boundary of 64 bytes: vectors across two cache lines would be slow to read back. They are a cache line
longer than the tile, because reads 4096 bytes behind a fresh store have to wait for it.

A block is passed over where the ellipse {alpha >= MIN_ALPHA} of the splat touches none of its pixels, or
where all of them are saturated: bits of an integer say so, block b is bit b. What would be drawn there is
exactly nothing: the image does not change.

Alpha is o exp(-q / 2), capped at MAX_ALPHA and not drawn below MIN_ALPHA. Where that cut comes to lie, an
image has no derivative; there is none of it in the gradient.
"""

import warp as wp

from digs_warp.device.contiguous import fill, floats_from, prefetch_floats
from digs_warp.device.elementary import larger, smaller
from digs_warp.splat.config import (
    BLOCK_HEIGHT,
    BLOCK_WIDTH,
    EXTENT_SLACK,
    MAX_ALPHA,
    MIN_ALPHA,
    TILE_PIXELS,
    TILE_SIZE,
)
from digs_warp.splat.records import (
    SPLAT_A,
    SPLAT_B,
    SPLAT_BLUE,
    SPLAT_C,
    SPLAT_FIELDS,
    SPLAT_GREEN,
    SPLAT_OPACITY,
    SPLAT_RED,
    SPLAT_U,
    SPLAT_V,
)

wp.set_module_options({"enable_backward": False})

_MIN_ALPHA = wp.constant(MIN_ALPHA)
_MAX_ALPHA = wp.constant(MAX_ALPHA)


@wp.func
def capped_and_cut(raw: float) -> float:
    """Alpha for raw = o exp(-q / 2): at most MAX_ALPHA, 0 below MIN_ALPHA."""
    alpha = wp.min(raw, _MAX_ALPHA)
    return wp.where(alpha >= _MIN_ALPHA, alpha, 0.0)


@wp.func
def slope_in_power(raw: float, alpha: float) -> float:
    """Derivative of alpha in -q / 2: alpha itself, and zero where it is capped or cut."""
    return wp.where(raw <= _MAX_ALPHA, alpha, 0.0)


_CACHE_LINE = 16  # floats
PLANE_FLOATS = TILE_PIXELS + _CACHE_LINE

TILE = wp.constant(TILE_SIZE)
PIXELS = wp.constant(TILE_PIXELS)
BLOCK = wp.constant(BLOCK_HEIGHT * BLOCK_WIDTH)
BLOCK_COLUMNS = wp.constant(BLOCK_WIDTH)
BLOCK_LINES = wp.constant(BLOCK_HEIGHT)
LINE_SHIFT = wp.constant(BLOCK_HEIGHT.bit_length() - 1)
BLOCK_SHIFT = wp.constant(BLOCK_WIDTH.bit_length() - 1)  # i >> shift is the row of pixel i
COLUMN_MASK = wp.constant(BLOCK_WIDTH - 1)
# Rows of blocks, and the pixels of the left half of a tile.
BLOCK_ROWS = wp.constant(TILE_SIZE // BLOCK_HEIGHT)
HALF_PIXELS = wp.constant(TILE_PIXELS // 2)
BLOCK_ROW_SHIFT = wp.constant((TILE_SIZE // BLOCK_HEIGHT).bit_length() - 1)
# i & mask is i, and tells LLVM that it is no negative index, which Warp would have to wrap: without it a
# third of the time of a row goes into index checks.
BLOCKS_MASK = wp.constant(TILE_PIXELS // (BLOCK_HEIGHT * BLOCK_WIDTH) - 1)
BLOCK_ROW_MASK = wp.constant(TILE_SIZE // BLOCK_HEIGHT - 1)
# Splats of a tile are drawn in groups; saturated blocks are looked up before each group.
GROUP = wp.constant(16)
# Blocks of a tile; those that are not saturated are one bit each.
BLOCKS = wp.constant(TILE_PIXELS // (BLOCK_HEIGHT * BLOCK_WIDTH))
ALL_BLOCKS = wp.constant((1 << TILE_PIXELS // (BLOCK_HEIGHT * BLOCK_WIDTH)) - 1)

# Coefficients of the polynomial for exp(x / 8): the powers of 1/8 are part of them.
_EXP_1 = wp.constant(0.999992658478104 / 8.0)
_EXP_2 = wp.constant(0.4998693944493127 / 8.0**2)
_EXP_3 = wp.constant(0.16589201244500917 / 8.0**3)
_EXP_4 = wp.constant(0.03960754759989449 / 8.0**4)
_EXP_5 = wp.constant(0.005739180249832998 / 8.0**5)


def planes_memory(planes: int) -> int:
    """Return how many floats hold ``planes`` planes at any alignment."""
    return planes * PLANE_FLOATS + _CACHE_LINE


@wp.func
def exp_in_range(x: float) -> float:
    """exp(x) for -5.55 <= x <= 0 (where alpha can reach 1/255), relative error below 3e-6.

    (p(x/8))^8 with a minimax polynomial of degree 5; below the range it stays under 1/255.
    """
    y = wp.max(x, -6.0)
    # Pairs of terms first: fewer operations wait for each other than in Horner's scheme.
    yy = y * y
    high = _EXP_4 + y * _EXP_5
    middle = _EXP_2 + y * _EXP_3
    p = (1.0 + y * _EXP_1) + yy * (middle + yy * high)
    p = p * p
    p = p * p
    return p * p


@wp.struct
class TileSplat:
    """What compositing reads of a splat; its center [px] is counted from that of the tile's first pixel."""

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
def tile_splat(splats: wp.array2d[float], g: int, tile_x: int, tile_y: int) -> TileSplat:
    """Splat g in a tile whose first pixel is (tile_x, tile_y)."""
    splat = TileSplat()
    splat.mean_x = splats[g, SPLAT_U] - float(tile_x) - 0.5
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
def prefetch_splat(splats: wp.array2d[float], members: wp.array[wp.vec2i], pair: int, end: int):
    """Ask for the record of a pair that comes soon, in this tile or the next: it is in no cache."""
    if pair < end:
        flat = wp.array(ptr=splats.ptr, shape=(1,), dtype=float)
        prefetch_floats(flat, members[pair][0] * SPLAT_FIELDS, SPLAT_FIELDS)


@wp.func
def block_left(block: int, splat: TileSplat) -> float:
    """Offset [px] of the first column of a block from the center of a splat."""
    return float((block >> BLOCK_ROW_SHIFT) * BLOCK_COLUMNS) - splat.mean_x


@wp.func
def block_top(block: int, splat: TileSplat) -> float:
    """Offset [px] of the first row of a block from the center of a splat."""
    return float((block & BLOCK_ROW_MASK) * BLOCK_LINES) - splat.mean_y


@wp.func
def power_at(splat: TileSplat, dx: float, dy: float) -> float:
    """-q / 2 at an offset [px] from the center."""
    return wp.min(dx * (splat.a_half * dx) + dy * (splat.c_half * dy - splat.b * dx), 0.0)


_SLACK = wp.constant(EXTENT_SLACK)


# LLVM would unroll the inner loop, and gather the lanes of all blocks.
_LIVE_BLOCKS = f"""
int live = 0;
for (int block = 0; block < {int(BLOCKS)}; ++block) {{
    float total = 0.0f;
#pragma clang loop unroll(disable)
    for (int lane = 0; lane < {int(BLOCK)}; ++lane)
        total += transmittances.data[{int(BLOCK)} * block + lane];
    live |= (total > 0.0f) << block;
}}
return live;
"""


@wp.func_native(_LIVE_BLOCKS)
def live_blocks(transmittances: wp.array[float]) -> int:
    """One bit for each block of a tile in which a pixel is not saturated, its transmittance not 0."""
    ...


@wp.func
def rows_between(first: float, last: float) -> int:
    """One bit for each row of blocks that the pixel rows first <= y <= last of a tile touch."""
    # Clamped as floats: a huge splat would overflow an integer.
    begin = int(smaller(larger(wp.ceil(first), 0.0), float(TILE))) >> LINE_SHIFT
    end = (int(smaller(larger(wp.floor(last), -1.0), float(TILE - 1))) + BLOCK_LINES) >> LINE_SHIFT
    return ((1 << end) - 1) & ~((1 << begin) - 1)


@wp.struct
class Ellipse:
    """The area {alpha >= MIN_ALPHA} of a splat: its center, and fields of its record.

    The center [px] is counted from that of the first pixel of a tile.
    """

    mean_x: float
    mean_y: float
    half_width: float
    slope: float
    chord: float
    taper: float
    peak: float


@wp.func
def half_chord(ellipse: Ellipse, dx: float) -> float:
    """Half the height of an ellipse in the column dx off its center."""
    return wp.sqrt(larger(ellipse.chord - ellipse.taper * dx * dx, 0.0))


@wp.func
def touched_rows(ellipse: Ellipse, left: float) -> int:
    """One bit for each block that an ellipse touches in a half of a tile.

    ``left`` is the first column of the half, counted from the center of the ellipse.
    """
    first = larger(left, -ellipse.half_width)
    last = smaller(left + float(BLOCK_COLUMNS - 1), ellipse.half_width)
    upper_dx = smaller(larger(-ellipse.peak, first), last)
    lower_dx = smaller(larger(ellipse.peak, first), last)
    upper = ellipse.mean_y + ellipse.slope * upper_dx - half_chord(ellipse, upper_dx) - _SLACK
    lower = ellipse.mean_y + ellipse.slope * lower_dx + half_chord(ellipse, lower_dx) + _SLACK
    return wp.where(wp.ceil(first - left) <= last - left, rows_between(upper, lower), 0)


@wp.func
def touched_blocks(ellipse: Ellipse) -> int:
    """One bit for each block of a tile in which a splat may be drawn."""
    right = float(BLOCK_COLUMNS) - ellipse.mean_x
    left_rows = touched_rows(ellipse, -ellipse.mean_x)
    return left_rows | (touched_rows(ellipse, right) << BLOCK_ROWS)


@wp.func
def lowest_bit(bits: int) -> int:
    """Index of the lowest of up to 24 bits, at least one: the exponent of its value as a float."""
    return (wp.cast(float(bits & -bits), wp.int32) >> 23) - 127


@wp.func
def fill_tile(
    start: int, width: int, height: int, pitch: int, value: float, plane: wp.array[float]
):
    """Set the pixels of a tile, of which ``width`` x ``height`` lie inside the image."""
    for y in range(height):
        fill(plane, start + y * pitch, width, value)


@wp.func
def write_row(count: int, source: wp.array[float], first: int, start: int, plane: wp.array[float]):
    """Write ``count`` pixels of one row of a block."""
    taken = floats_from(source, first, count)
    row = floats_from(plane, start, count)
    if count == BLOCK_COLUMNS:
        for x in range(BLOCK_COLUMNS):
            row[x] = taken[x]
    else:
        for t in range(count):
            row[t] = taken[t]
