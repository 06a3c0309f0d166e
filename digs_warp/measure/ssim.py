"""Structural similarity and L1 between two images, fused, with the gradient of their sum.

Legend (Wang et al. 2004): m and s are mean and variance under an 11x11 Gaussian window W (sigma 1.5), x
the rendered image, y the target, per channel; pixels outside the image are 0 (zero padding, as in the 3DGS
reference).

    A = 2 m_x m_y + C1,  B = 2 s_xy + C2,  D = m_x^2 + m_y^2 + C1,  E = s_x + s_y + C2
    SSIM = A B / (D E)

With the moments m_x, e_xx = W * x^2 and e_xy = W * x y as variables (s_x = e_xx - m_x^2 and so on; e_xx and
e_yy are only needed as their sum),

    dSSIM/de_xx = -SSIM / E
    dSSIM/de_xy = 2 A / (D E)
    dSSIM/dm_x  = 2 (m_y B / E - m_x SSIM) / D - 2 m_x dSSIM/de_xx - m_y dSSIM/de_xy

and, because W is symmetric, the gradient of the sum of SSIM over all pixels is

    W * dSSIM/dm_x + 2 x (W * dSSIM/de_xx) + y (W * dSSIM/de_xy)

One thread walks down a strip of 64 columns of one channel, at most `SEGMENT_ROWS` rows. It keeps only the
last rows of every stage, in ring buffers as high as a window: image line -> moments, blurred along the row
-> blurred along the column, SSIM and its derivatives -> blurred along the row -> blurred along the column,
gradient. No intermediate result goes through memory; in exchange, the derivatives in the columns around a
strip are computed twice. Only active blocks are computed: elsewhere image and target are the same
background, SSIM is 1 and its gradient is 0.
"""

import math

import warp as wp

from digs_warp.device.contiguous import cache_line_at, floats_from, prefetch_floats
from digs_warp.device.image_planes import PlaneLayout
from digs_warp.device.kernel_options import exact_vector_module_options

# Products and sums are not contracted, except in a window: if fused, the variance of two equal constants
# would not cancel, and SSIM would be off from 1 by 1e-4.
wp.set_module_options(exact_vector_module_options())

WINDOW = 11
REACH = WINDOW // 2  # the window reaches this far [px]
SIGMA = 1.5
C1 = 0.01**2  # for values in 0..1
C2 = 0.03**2


def window_weights() -> list[float]:
    """Return the 11 weights of the separable window; they sum to 1."""
    raw = [math.exp(-((i - REACH) ** 2) / (2 * SIGMA**2)) for i in range(WINDOW)]
    return [value / sum(raw) for value in raw]


# The window is symmetric: the weights of two taps at distance 5, 4, 3, 2, 1, and that of the middle one.
_PAIRS, _MIDDLE = window_weights()[:REACH], window_weights()[REACH]

# Products and sums are fused here alone. Pointers that share no memory, and loops of a length that is known
# where the function is inlined, become vector code without a check whether they overlap.
_FUSED = "#pragma clang fp contract(fast)"
_ALONG_SUM = [
    f"{w:.9g}f * (from[x + {i}] + from[x + {2 * REACH - i}])" for i, w in enumerate(_PAIRS)
]
_ALONG = f"""
{_FUSED}
const float* __restrict from = source.data + first;
float* __restrict to = result.data + start;
for (int x = 0; x < count; ++x)
    to[x] = {" + ".join([*_ALONG_SUM, f"{_MIDDLE:.9g}f * from[x + {REACH}]"])};
"""
# The rows of a ring, from 5 above to 5 below, where `digs_warp.measure.ssim.ring_place` puts them.
_RING = f"const float* __restrict ring = source.data + first;\nconst unsigned place = row + {4 * WINDOW};\n"
_WINDOW_RING_ROWS = "".join(
    f"const float* row{i} = ring + (place + {i - REACH}u) % {WINDOW}u * count;\n"
    for i in range(WINDOW)
)
_ACROSS_SUM = [f"{w:.9g}f * (row{i}[c] + row{2 * REACH - i}[c])" for i, w in enumerate(_PAIRS)]
_ACROSS = f"""
{_FUSED}
{_RING}{_WINDOW_RING_ROWS}
float* __restrict to = result.data + start;
for (int c = 0; c < count; ++c)
    to[c] = {" + ".join([*_ACROSS_SUM, f"{_MIDDLE:.9g}f * row{REACH}[c]"])};
"""


@wp.func_native(_ALONG)
def blur_along(
    source: wp.array[float], first: int, result: wp.array[float], start: int, count: int
):
    """Blur ``count`` values of a row; ``source`` has 10 more, from ``first`` on."""
    ...


@wp.func_native(_ACROSS)
def blur_across(
    source: wp.array[float],
    first: int,
    row: int,
    result: wp.array[float],
    start: int,
    count: int,
):
    """Blur ``row`` across the rows of a ring: 11 of them, each of ``count`` values, from ``first`` on."""
    ...


# Blocks are active or not; a strip is one block wide.
BLOCK_ROWS = 16
BLOCK_COLUMNS = 64
# A thread's part of a strip: long, because each part begins with 20 rows that only fill the rings.
SEGMENT_ROWS = 512


_C1 = wp.constant(C1)
_C2 = wp.constant(C2)
_ROWS = wp.constant(BLOCK_ROWS)
_COLUMNS = wp.constant(BLOCK_COLUMNS)
_SEGMENT_BLOCKS = wp.constant(SEGMENT_ROWS // BLOCK_ROWS)
_REACH = wp.constant(REACH)
_TWICE = wp.constant(2 * REACH)

# Derivatives are needed one window around the strip, rounded up to whole vectors ...
_MARGIN_COLUMNS = 8
_WIDE_COLUMNS = BLOCK_COLUMNS + 2 * _MARGIN_COLUMNS
_MARGIN = wp.constant(_MARGIN_COLUMNS)
_WIDE = wp.constant(_WIDE_COLUMNS)
# ... and the image one window around those, rounded up, too, so that lines begin where vectors in memory do.
# Four lines are kept of each row (x, y, x^2 + y^2, x y), twice.
_LINE_MARGIN_COLUMNS = 16
_LINE_COLUMNS = BLOCK_COLUMNS + 2 * _LINE_MARGIN_COLUMNS
_LINE_MARGIN = wp.constant(_LINE_MARGIN_COLUMNS)
# Where the windows of the derivatives begin in a line.
_WINDOWS = wp.constant(_LINE_MARGIN_COLUMNS - _MARGIN_COLUMNS - REACH)
_LINE = wp.constant(_LINE_COLUMNS)
_LINES = wp.constant(4 * _LINE_COLUMNS)
_LINES_SIZE = 8 * _LINE_COLUMNS
# Rows to prefetch: they are a pitch apart, which the processor does not predict.
_AHEAD = wp.constant(4)
# Rings of blurred rows: of the four moments, and of the three derivatives.
_RING_ROWS = wp.constant(WINDOW)
_SEVERAL_RINGS = wp.constant(4 * WINDOW)
_NOT_NEGATIVE = wp.constant(0x7FFFFFFF)
_MOMENT_RING = wp.constant(WINDOW * _WIDE_COLUMNS)
_MOMENTS_SIZE = 4 * WINDOW * _WIDE_COLUMNS
_GRADIENT_RING = wp.constant(WINDOW * BLOCK_COLUMNS)
_GRADIENTS_SIZE = 3 * WINDOW * BLOCK_COLUMNS
# Lines of the derivatives of a row and of 1 - SSIM, twice; then which columns exist, the sums of each column,
# and the gradient of a row.
_DERIVATIVES = wp.constant(4 * _WIDE_COLUMNS)
_EXISTS = wp.constant(8 * _WIDE_COLUMNS)
_SUM_L1 = wp.constant(9 * _WIDE_COLUMNS)
_SUM_DSSIM = wp.constant(10 * _WIDE_COLUMNS)
_GRADIENT = wp.constant(11 * _WIDE_COLUMNS)
_ROWS_SIZE = 14 * _WIDE_COLUMNS
# All lie in one piece of memory, from a cache line on: a vector that crosses two of them is read twice.
_CACHE_LINE = 16
_MEMORY = _LINES_SIZE + _MOMENTS_SIZE + _GRADIENTS_SIZE + _ROWS_SIZE + _CACHE_LINE
# Where the parts begin [bytes].
_MOMENTS_AT = wp.constant(wp.uint64(4 * _LINES_SIZE))
_GRADIENTS_AT = wp.constant(wp.uint64(4 * (_LINES_SIZE + _MOMENTS_SIZE)))
_ROWS_AT = wp.constant(wp.uint64(4 * (_LINES_SIZE + _MOMENTS_SIZE + _GRADIENTS_SIZE)))


@wp.struct
class Terms:
    """What is the same for all pixels of a view."""

    layout: PlaneLayout  # of all planes
    columns: int  # of the largest view
    rows: int
    size: int  # of 3 planes
    l1_weight: float
    dssim_weight: float


@wp.func
def ring_place(row: int) -> int:
    """Return the position of a row in a ring.

    The ring has 11 rows, not 16: with a power of two, LLVM derives positions from each other bit by bit, and
    the loops that read there become gathers.
    """
    # Rows above the image are negative; a mask shows LLVM that the sum is not.
    return ((row + _SEVERAL_RINGS) & _NOT_NEGATIVE) % _RING_ROWS


@wp.kernel
def similarity_kernel(
    first: int,
    terms: Terms,
    active: wp.array2d[int],  # [blocks_y, blocks_x] not 0 where the loss counts
    image: wp.array[float],  # 3 padded planes
    target: wp.array[float],  # 3 padded planes
    # outputs
    adj_image: wp.array[float],  # 3 padded planes
    sums: wp.array2d[float],  # [strips, 2] sums of |x - y| and of 1 - SSIM
):
    """Compare a strip of one channel; write d(l1_weight sum |x - y| + dssim_weight sum (1 - SSIM)) / dx.

    The gradient holds where the next 10 pixels on each side are compared or are background in both images.
    """
    strip = first + wp.tid()
    blocks_x = active.shape[1]
    blocks_y = active.shape[0]
    width = terms.layout.width
    height = terms.layout.height
    pitch = terms.layout.pitch
    l1_weight = terms.l1_weight
    dssim_weight = terms.dssim_weight
    segments = (blocks_y + _SEGMENT_BLOCKS - 1) // _SEGMENT_BLOCKS
    channel = strip // (blocks_x * segments)
    block_x = strip % blocks_x
    first_block = strip // blocks_x % segments * _SEGMENT_BLOCKS
    sums[strip, 0] = 0.0
    sums[strip, 1] = 0.0
    top = int(blocks_y * _ROWS)
    end = int(0)
    for block in range(first_block, wp.min(first_block + _SEGMENT_BLOCKS, blocks_y)):
        if active[block, block_x] != 0:
            top = wp.min(top, block * _ROWS)
            end = wp.min((block + 1) * _ROWS, height)
    if top >= end:
        return
    left = block_x * _COLUMNS
    columns = wp.min(_COLUMNS, width - left)
    base = terms.layout.origin + channel * terms.layout.plane + left
    memory = wp.zeros(shape=(wp.static(_MEMORY),), dtype=float)
    start = cache_line_at(memory.ptr)
    line = wp.array(ptr=start, shape=(wp.static(_LINES_SIZE),), dtype=float)
    moments = wp.array(ptr=start + _MOMENTS_AT, shape=(wp.static(_MOMENTS_SIZE),), dtype=float)
    gradients = wp.array(
        ptr=start + _GRADIENTS_AT, shape=(wp.static(_GRADIENTS_SIZE),), dtype=float
    )
    rows = wp.array(ptr=start + _ROWS_AT, shape=(wp.static(_ROWS_SIZE),), dtype=float)
    for i_e in range(_WIDE):
        column = left - _MARGIN + i_e
        rows[_EXISTS + i_e] = wp.where(column >= 0 and column < width, 1.0, 0.0)
    # A row is blurred one iteration after it was written, while the next is written elsewhere: a read across
    # two vectors that were just written would have to wait until both reach the cache.
    for turn in range(top - _TWICE, end + _TWICE + 2):
        half = (turn & 1) * _LINES
        source = base + turn * pitch - _LINE_MARGIN
        prefetch_floats(image, source + _AHEAD * pitch, _LINE)
        prefetch_floats(target, source + _AHEAD * pitch, _LINE)
        image_line = floats_from(image, source, _LINE)
        target_line = floats_from(target, source, _LINE)
        for i in range(_LINE):
            x = image_line[i]
            y = target_line[i]
            line[half + i] = x
            line[half + _LINE + i] = y
            line[half + 2 * _LINE + i] = x * x + y * y
            line[half + 3 * _LINE + i] = x * y
        if turn > top - _TWICE:
            to_row = ring_place(turn - 1) * _WIDE
            for moment in range(4):
                o = _LINES - half + moment * _LINE + _WINDOWS
                b = moment * _MOMENT_RING + to_row
                blur_along(line, o, moments, b, _WIDE)
        row = turn - 1 - _REACH
        present = (row & 1) * _DERIVATIVES
        if row >= top - _REACH:
            for moment_v in range(4):
                p = moment_v * _MOMENT_RING
                m = present + moment_v * _WIDE
                blur_across(moments, p, row, rows, m, _WIDE)
            inside = float(0.0)
            if row >= 0 and row < height:
                inside = float(1.0)
            # From moments to SSIM and its derivatives, in place.
            for col in range(_WIDE):
                mean_x = rows[present + col]
                mean_y = rows[present + _WIDE + col]
                squares = mean_x * mean_x + mean_y * mean_y
                a = 2.0 * mean_x * mean_y + _C1
                s = 2.0 * (rows[present + 3 * _WIDE + col] - mean_x * mean_y) + _C2
                d = squares + _C1
                e = rows[present + 2 * _WIDE + col] - squares + _C2
                inverse = 1.0 / (d * e)
                ssim = a * s * inverse
                g_xx = -ssim * d * inverse
                g_xy = 2.0 * a * inverse
                g_mean = (
                    2.0 * (mean_y * s * inverse - mean_x * ssim * e * inverse)
                    - 2.0 * mean_x * g_xx
                    - mean_y * g_xy
                )
                weight = inside * rows[_EXISTS + col]
                rows[present + col] = weight * g_mean
                rows[present + _WIDE + col] = weight * g_xx
                rows[present + 2 * _WIDE + col] = weight * g_xy
                rows[present + 3 * _WIDE + col] = weight * (1.0 - ssim)
            counts = row >= top and row < end
            if counts:
                counts = active[row // _ROWS, block_x] != 0
            if counts:
                image_row = floats_from(image, base + row * pitch, _COLUMNS)
                target_row = floats_from(target, base + row * pitch, _COLUMNS)
                for j in range(_COLUMNS):
                    at = _MARGIN + j
                    apart = wp.abs(image_row[j] - target_row[j])
                    rows[_SUM_L1 + j] = rows[_SUM_L1 + j] + rows[_EXISTS + at] * apart
                    rows[_SUM_DSSIM + j] = rows[_SUM_DSSIM + j] + rows[present + 3 * _WIDE + at]
        if row > top - _REACH:
            to_gradients = ring_place(row - 1) * _COLUMNS
            for derivative in range(3):
                og = _DERIVATIVES - present + derivative * _WIDE + _MARGIN - _REACH
                bg = derivative * _GRADIENT_RING + to_gradients
                blur_along(rows, og, gradients, bg, _COLUMNS)
        done = row - 1 - _REACH
        if done >= top:
            for derivative_v in range(3):
                pg = derivative_v * _GRADIENT_RING
                mg = _GRADIENT + derivative_v * _COLUMNS
                blur_across(gradients, pg, done, rows, mg, _COLUMNS)
            image_done = floats_from(image, base + done * pitch, _COLUMNS)
            target_done = floats_from(target, base + done * pitch, _COLUMNS)
            for k in range(_COLUMNS):
                xd = image_done[k]
                yd = target_done[k]
                d_ssim = rows[_GRADIENT + k] + 2.0 * xd * rows[_GRADIENT + _COLUMNS + k]
                d_ssim = d_ssim + yd * rows[_GRADIENT + 2 * _COLUMNS + k]
                sign = wp.where(xd > yd, 1.0, wp.where(xd < yd, -1.0, 0.0))
                rows[_GRADIENT + k] = l1_weight * sign - dssim_weight * d_ssim
            out_row = floats_from(adj_image, base + done * pitch, _COLUMNS)
            if columns == _COLUMNS:
                for out in range(_COLUMNS):
                    out_row[out] = rows[_GRADIENT + out]
            else:
                for out_t in range(columns):
                    out_row[out_t] = rows[_GRADIENT + out_t]
    total_l1 = float(0.0)
    total_dssim = float(0.0)
    for summed in range(_COLUMNS):
        total_l1 += rows[_SUM_L1 + summed]
        total_dssim += rows[_SUM_DSSIM + summed]
    sums[strip, 0] = total_l1
    sums[strip, 1] = total_dssim
