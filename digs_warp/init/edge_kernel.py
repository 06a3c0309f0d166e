"""Kernel of `digs_warp.init.edges`: the magnitude of the Laplacian, and the sums that its threshold needs.

One thread per tile of 64x16 pixels. The tile's depth values are in one local array, so that LLVM vectorizes
the loop over a row and the loop over its sums; missing values are selected away instead of branched around.
Rows are read and written through views with a stride that LLVM knows: element by element, loading and
storing took longer than the Laplacian itself.
"""

import warp as wp

from digs_warp.device.contiguous import floats_from
from digs_warp.device.kernel_options import vector_module_options

wp.set_module_options(vector_module_options())

TILE_WIDTH, TILE_HEIGHT = 64, 16
REACH = 2  # pixels from the center to the rim of the kernel

_WIDTH = wp.constant(TILE_WIDTH)
_HEIGHT = wp.constant(TILE_HEIGHT)
_REACH = wp.constant(REACH)
_STRIDE = wp.constant(TILE_WIDTH + 2 * REACH)
_ROWS = wp.constant(TILE_HEIGHT + 2 * REACH)
_NEAR = wp.constant((TILE_WIDTH + 2 * REACH) * (TILE_HEIGHT + 2 * REACH))
# y & 15 is y, and shows LLVM that the index is not negative, which Warp would have to wrap.
_ROW_MASK = wp.constant(TILE_HEIGHT - 1)


@wp.struct
class ImagePart:
    """A part of an image [px]."""

    top: int
    left: int
    height: int
    width: int


@wp.func
def known(bend: float) -> float:
    """Return 1 where both members of a pair are measured, else 0."""
    return wp.where(bend == bend, 1.0, 0.0)


@wp.func
def or_zero(bend: float) -> float:
    """Return the value of a pair, or 0 where a member is missing."""
    return wp.where(bend == bend, bend, 0.0)


@wp.kernel
def laplacian_kernel(
    first: int,
    depth: wp.array[float],  # [height * width] NaN: unknown
    height: int,
    width: int,
    tile_columns: int,
    total_weight: float,  # of all pairs
    min_weight: float,  # below which a pixel is not judged
    part: ImagePart,  # whose magnitudes are wanted
    # outputs
    magnitude: wp.array[float],  # [size of the part] |E|, NaN where not judged
    sums: wp.array2d[
        wp.float64
    ],  # [tiles, 3] number, sum and sum of squares of |E|, over the whole image
):
    """Write |E|. The weights of the pairs are those of `digs_warp.init.edges.LAPLACIAN_5X5`."""
    tile = first + wp.tid()
    top = (tile // tile_columns) * _HEIGHT
    left = (tile % tile_columns) * _WIDTH
    near = wp.zeros(shape=(_NEAR,), dtype=float)
    for load_y in range(_ROWS):
        row = top + load_y - _REACH
        if row >= 0 and row < height and left >= _REACH and left + _WIDTH + _REACH <= width:
            line_in = floats_from(depth, row * width + left - _REACH, _STRIDE)
            for load_x in range(_STRIDE):
                near[load_y * _STRIDE + load_x] = line_in[load_x]
        else:
            for edge_x in range(_STRIDE):
                column = left + edge_x - _REACH
                loaded = wp.nan
                if row >= 0 and row < height and column >= 0 and column < width:
                    loaded = depth[row * width + column]
                near[load_y * _STRIDE + edge_x] = loaded
    from_x = wp.max(part.left - left, 0)
    to_x = wp.min(part.left + part.width - left, _WIDTH)
    line = wp.zeros(shape=(_WIDTH,), dtype=float)
    count = wp.float64(0.0)
    total = wp.float64(0.0)
    squares = wp.float64(0.0)
    for y in range(_HEIGHT):
        row0 = (y & _ROW_MASK) * _STRIDE
        row1 = row0 + _STRIDE
        row2 = row1 + _STRIDE
        row3 = row2 + _STRIDE
        row4 = row3 + _STRIDE
        for x in range(_WIDTH):
            twice = 2.0 * near[row2 + x + 2]
            # Opposite pairs, named by the row and column of their first member.
            b00 = near[row0 + x] + near[row4 + x + 4] - twice
            b01 = near[row0 + x + 1] + near[row4 + x + 3] - twice
            b02 = near[row0 + x + 2] + near[row4 + x + 2] - twice
            b03 = near[row0 + x + 3] + near[row4 + x + 1] - twice
            b04 = near[row0 + x + 4] + near[row4 + x] - twice
            b10 = near[row1 + x] + near[row3 + x + 4] - twice
            b12 = near[row1 + x + 2] + near[row3 + x + 2] - twice
            b14 = near[row1 + x + 4] + near[row3 + x] - twice
            b20 = near[row2 + x] + near[row2 + x + 4] - twice
            b21 = near[row2 + x + 1] + near[row2 + x + 3] - twice
            known2 = known(b00) + known(b04)
            known4 = known(b01) + known(b02) + known(b03) + known(b10) + known(b14) + known(b20)
            known8 = known(b12) + known(b21)
            sum2 = or_zero(b00) + or_zero(b04)
            sum4 = or_zero(b01) + or_zero(b02) + or_zero(b03) + or_zero(b10) + or_zero(b14)
            sum4 = sum4 + or_zero(b20)
            sum8 = or_zero(b12) + or_zero(b21)
            weight = 2.0 * known2 + 4.0 * known4 + 8.0 * known8
            response = (2.0 * sum2 + 4.0 * sum4 - 8.0 * sum8) * (total_weight / weight)
            line[x] = wp.where(weight >= min_weight, wp.abs(response), wp.nan)
        if top + y < height:
            inside = wp.min(_WIDTH, width - left)
            row_count = float(0.0)
            row_total = float(0.0)
            row_squares = float(0.0)
            for sum_x in range(_WIDTH):
                found = line[sum_x]
                counts = found == found and sum_x < inside
                row_count += wp.where(counts, 1.0, 0.0)
                row_total += wp.where(counts, found, 0.0)
                row_squares += wp.where(counts, found * found, 0.0)
            count += wp.float64(row_count)
            total += wp.float64(row_total)
            squares += wp.float64(row_squares)
            if top + y >= part.top and top + y < part.top + part.height:
                box_row = (top + y - part.top) * part.width + left + from_x - part.left
                line_out = floats_from(magnitude, box_row, to_x - from_x)
                for write_x in range(to_x - from_x):
                    line_out[write_x] = line[from_x + write_x]
    sums[tile, 0] = count
    sums[tile, 1] = total
    sums[tile, 2] = squares
