"""Which blocks of a tile a splat is drawn in, as bits of an integer: block b is bit b.

A block is passed over where the ellipse {alpha >= min_alpha} of the splat touches none of its pixels, or
where all of them are saturated. What would be drawn there is exactly nothing: the image does not change.
"""

import warp as wp

from digs_warp.device.contiguous import floats_from
from digs_warp.device.elementary import larger, smaller
from digs_warp.splat.config import EXTENT_SLACK
from digs_warp.splat.tile import (
    BLOCK,
    BLOCK_COLUMNS,
    BLOCK_LINES,
    BLOCK_ROWS,
    BLOCKS,
    LINE_SHIFT,
    TILE,
)

wp.set_module_options({"enable_backward": False})

_SLACK = wp.constant(EXTENT_SLACK)


@wp.func
def live_blocks(transmittances: wp.array[float]) -> int:
    """One bit for each block of a tile in which a pixel is not saturated, its transmittance not 0."""
    live = int(0)
    for block in range(BLOCKS):
        pixels = floats_from(transmittances, block * BLOCK, BLOCK)
        total = float(0.0)
        for lane in range(BLOCK):
            total += pixels[lane]
        live |= wp.where(total > 0.0, 1 << block, 0)
    return live


@wp.func
def rows_between(first: float, last: float) -> int:
    """One bit for each row of blocks that the pixel rows first <= y <= last of a tile touch."""
    # Clamped as floats: a huge splat would overflow an integer.
    begin = int(smaller(larger(wp.ceil(first), 0.0), float(TILE))) >> LINE_SHIFT
    end = (int(smaller(larger(wp.floor(last), -1.0), float(TILE - 1))) + BLOCK_LINES) >> LINE_SHIFT
    return ((1 << end) - 1) & ~((1 << begin) - 1)


@wp.struct
class Ellipse:
    """The area {alpha >= min_alpha} of a splat: its center, and fields of its record.

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
