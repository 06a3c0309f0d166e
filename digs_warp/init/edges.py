"""Laplacian edge filter: stereo depth is least reliable where it jumps (paper section 3.3.1, eq. 9).

A matching window that straddles an object's outline sees two depths and reports something between
them; back-projected, such pixels float between the object and its surroundings. The filter keeps the
pixels whose Laplacian response E is small, ``|E| < mean(|E|) + 0.1 std(|E|)``.

Depth maps have holes (NaN). An ordinary convolution would either spread the holes or, with a value
filled in, find an edge around each of them. Here the Laplacian is a sum over *opposite pairs* of
neighbors, ``E = sum K_k (d_k + d_-k - 2 d_0)``: without holes it is the usual 5x5 Laplacian (K is
symmetric and sums to zero), and pairs with a missing member drop out without leaving a trace, because
every single pair is zero on a plane, however slanted. A step keeps its response as long as pairs
across it remain.
"""

import numpy as np
import warp as wp

from digs_warp.device.contiguous import floats_from
from digs_warp.device.kernel_options import vector_module_options
from digs_warp.device.parallel import launch_here

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
    # [16 tile rows + 4, 64 tile columns + 4] with a rim of NaN, unknown, of two pixels or more
    depth: wp.array[float],
    tile_columns: int,
    total_weight: float,  # of all pairs
    min_weight: float,  # below which a pixel is not judged
    # outputs
    magnitude: wp.array[float],  # [tile rows * 16, tile columns * 64] |E|, NaN where not judged
    sums: wp.array2d[wp.float64],  # [tiles, 3] number, sum and sum of squares of |E|
):
    """Write |E|. The weights of the pairs are those of `digs_warp.init.edges.LAPLACIAN_5X5`."""
    tile = first + wp.tid()
    top = (tile // tile_columns) * _HEIGHT
    left = (tile % tile_columns) * _WIDTH
    width = tile_columns * _WIDTH
    near = wp.zeros(shape=(_NEAR,), dtype=float)
    for load_y in range(_ROWS):
        line_in = floats_from(depth, (top + load_y) * (width + 2 * _REACH) + left, _STRIDE)
        for load_x in range(_STRIDE):
            near[load_y * _STRIDE + load_x] = line_in[load_x]
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
        row_count = float(0.0)
        row_total = float(0.0)
        row_squares = float(0.0)
        for sum_x in range(_WIDTH):
            found = line[sum_x]
            counts = found == found
            row_count += wp.where(counts, 1.0, 0.0)
            row_total += wp.where(counts, found, 0.0)
            row_squares += wp.where(counts, found * found, 0.0)
        count += wp.float64(row_count)
        total += wp.float64(row_total)
        squares += wp.float64(row_squares)
        line_out = floats_from(magnitude, (top + y) * width + left, _WIDTH)
        for write_x in range(_WIDTH):
            line_out[write_x] = line[write_x]
    sums[tile, 0] = count
    sums[tile, 1] = total
    sums[tile, 2] = squares


# Rows and columns of a part of an image; starts and stops are given.
Box = tuple[slice, slice]

# Rows of the 5x5 Sobel second derivative and its smoothing: this is OpenCV's Laplacian of size 5.
_SECOND_DERIVATIVE = np.array([1.0, 0.0, -2.0, 0.0, 1.0])
_SMOOTHING = np.array([1.0, 4.0, 6.0, 4.0, 1.0])
LAPLACIAN_5X5 = np.outer(_SMOOTHING, _SECOND_DERIVATIVE) + np.outer(_SECOND_DERIVATIVE, _SMOOTHING)
# Each pair has one weight; the center's weight is the sum of all others.
_TOTAL_WEIGHT = float(np.abs(LAPLACIAN_5X5).sum() - abs(LAPLACIAN_5X5[2, 2])) / 2

# A pixel with less than this share of the pairs is dropped. The two rows of pixels along a straight hole
# keep 27 % and 64 %, the neighbors of a single missing pixel at least 81 %. So the rim of a large hole is
# dropped, where often the far side of a jump is missing and only the mixed pixels remain. (On 60 noisy views
# of a bottle without measured background, 19 % of the voxels were more than 1 cm off with a share of one
# third, 0.4 % with three quarters, at the same coverage of the surface.)
MIN_PAIR_WEIGHT = 0.75

STD_FRACTION = 0.1  # "10 % of the standard deviation" (section 4.1)


def edge_magnitude(depth: np.ndarray) -> tuple[np.ndarray, float]:
    """Return |E| of a depth map [m], shape (height, width), float32, and the threshold tau_edge.

    Where some pairs are missing, the response of the others is scaled up to the full kernel. NaN: the
    pixel has no depth, or too few measured neighbors to judge. The threshold is NaN when none is known.
    """
    height, width = depth.shape
    tile_rows, tile_columns = -(-height // TILE_HEIGHT), -(-width // TILE_WIDTH)
    whole = np.array([tile_rows * TILE_HEIGHT, tile_columns * TILE_WIDTH])
    padded = np.full(whole + 2 * REACH, np.nan, np.float32)
    padded[REACH : REACH + height, REACH : REACH + width] = depth
    magnitude = np.empty(whole, np.float32)
    sums = np.empty((tile_rows * tile_columns, 3))
    weights = _TOTAL_WEIGHT, MIN_PAIR_WEIGHT * _TOTAL_WEIGHT
    out = on_device(magnitude.reshape(-1)), on_device(sums)
    inputs = [0, on_device(padded.reshape(-1)), tile_columns, *weights, *out]
    launch_here(laplacian_kernel, len(sums), inputs)
    count, total, squares = sums.sum(axis=0)
    if count == 0:
        return magnitude[:height, :width], float("nan")
    mean = total / count
    deviation = np.sqrt(max(squares / count - mean * mean, 0.0))
    return magnitude[:height, :width], float(mean + STD_FRACTION * deviation)


def smooth_depth(depth: np.ndarray, box: Box | None = None) -> np.ndarray:
    """Return where depth is known and far from a jump, bool, the shape of ``depth`` or of ``box``.

    On a perfectly flat map, where all responses are equal, all measured pixels pass.
    """
    magnitude, threshold = edge_magnitude(depth)
    return (magnitude if box is None else magnitude[box]) <= threshold


def on_device(array: np.ndarray) -> wp.array:
    """Return a Warp array on the CPU that shares the memory of ``array``."""
    return wp.array(array, device="cpu", copy=False)
