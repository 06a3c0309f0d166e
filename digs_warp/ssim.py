# type: ignore
# (device code, which Warp's stubs do not type)
"""Structural similarity and L1 between two images, fused, with the gradient of their sum.

Legend (Wang et al. 2004): m and s are mean and variance under an 11x11 Gaussian window W (sigma 1.5), x
the rendered image, y the target, per channel; pixels outside the image are 0 (zero padding, as in the 3DGS
reference).

    A = 2 m_x m_y + C1,  B = 2 s_xy + C2,  D = m_x^2 + m_y^2 + C1,  E = s_x + s_y + C2
    SSIM = A B / (D E)

With the moments m_x, e_xx = W * x^2 and e_xy = W * x y as variables (s_x = e_xx - m_x^2 and so on),

    dSSIM/de_xx = -SSIM / E
    dSSIM/de_xy = 2 A / (D E)
    dSSIM/dm_x  = 2 (m_y B / E - m_x SSIM) / D - 2 m_x dSSIM/de_xx - m_y dSSIM/de_xy

and, because W is symmetric, the gradient of the sum of SSIM over all pixels is

    W * dSSIM/dm_x + 2 x (W * dSSIM/de_xx) + y (W * dSSIM/de_xy)

Where pixels have weights w, the sum is that of w SSIM: the three derivatives are multiplied by w before they
are blurred.

One thread works on a block of 16 rows by 64 columns of one channel. Only active blocks are computed:
elsewhere image and target are the same background, SSIM is 1 and its gradient 0.
"""

import math

import warp as wp

from digs_warp.contiguous import floats_from

# Products and sums are not contracted: fused, the variance of two equal constants would not cancel, and SSIM
# would miss 1 by 1e-4.
wp.set_module_options({"enable_backward": False, "max_unroll": 1, "optimization_level": 3})

WINDOW = 11
REACH = WINDOW // 2  # the window reaches this far [px]
SIGMA = 1.5
C1 = 0.01**2  # for values in 0..1
C2 = 0.03**2

BLOCK_ROWS = 16
BLOCK_COLUMNS = 64


def window_weights() -> list[float]:
    """Return the 11 weights of the separable window; they sum to 1."""
    raw = [math.exp(-((i - REACH) ** 2) / (2 * SIGMA**2)) for i in range(WINDOW)]
    return [value / sum(raw) for value in raw]


# The window is symmetric: weights of the taps at distance 5, 4, 3, 2, 1, 0.
_W5, _W4, _W3, _W2, _W1, _W0 = (wp.constant(value) for value in window_weights()[: REACH + 1])
_C1 = wp.constant(C1)
_C2 = wp.constant(C2)
_ROWS = wp.constant(BLOCK_ROWS)
_COLUMNS = wp.constant(BLOCK_COLUMNS)
_REACH = wp.constant(REACH)
_HALO_ROWS = wp.constant(BLOCK_ROWS + 2 * REACH)
# One image line with its halo, and the block's lines after the horizontal pass, one after the other.
_LINE = wp.constant(BLOCK_COLUMNS + 2 * REACH)
_LINES_5 = wp.constant(5 * (BLOCK_COLUMNS + 2 * REACH))
_LINES_10 = wp.constant(10 * (BLOCK_COLUMNS + 2 * REACH))
_LINES_4 = wp.constant(4 * (BLOCK_COLUMNS + 2 * REACH))
# index & _NOT_NEGATIVE is the index, and tells LLVM that it is no negative one, which Warp would have to
# wrap: only then are the reads of image lines vectorized.
_NOT_NEGATIVE = wp.constant(0x7FFFFFFF)
_MAP = wp.constant((BLOCK_ROWS + 2 * REACH) * BLOCK_COLUMNS)
_MAPS_5 = wp.constant(5 * (BLOCK_ROWS + 2 * REACH) * BLOCK_COLUMNS)
_MAPS_3 = wp.constant(3 * (BLOCK_ROWS + 2 * REACH) * BLOCK_COLUMNS)


@wp.func
def window_sum(d5: float, d4: float, d3: float, d2: float, d1: float, d0: float) -> float:
    """Weighted sum of eleven taps, given as sums of the two at distance 5, 4, 3, 2, 1 and the middle one."""
    return _W5 * d5 + _W4 * d4 + _W3 * d3 + _W2 * d2 + _W1 * d1 + _W0 * d0


@wp.kernel
def similarity_kernel(
    first: int,
    blocks_x: int,
    blocks_y: int,
    width: int,
    height: int,
    pitch: int,
    plane: int,
    origin: int,
    active: wp.array[int],  # [blocks_y * blocks_x] not 0 where the loss counts
    image: wp.array[float],  # 3 padded planes
    target: wp.array[float],  # 3 padded planes
    weighted: int,  # whether pixels count as much as ``weights`` say; otherwise all count 1
    weights: wp.array[float],  # 1 padded plane
    # outputs
    maps: wp.array[float],  # 9 padded planes: weight * dSSIM / d(m_x, e_xx, e_xy) of each channel
    sums: wp.array2d[float],  # [blocks, 2] weighted sums of |x - y| and of 1 - SSIM
):
    """Compare one block of one channel."""
    block = first + wp.tid()
    channel = block // (blocks_x * blocks_y)
    left = (block % blocks_x) * _COLUMNS
    top = (block // blocks_x % blocks_y) * _ROWS
    sums[block, 0] = 0.0
    sums[block, 1] = 0.0
    if active[block % (blocks_x * blocks_y)] == 0:
        return
    line = wp.zeros(shape=(_LINES_10,), dtype=float)
    blur = wp.zeros(shape=(_MAPS_5,), dtype=float)
    base = origin + channel * plane + top * pitch + left
    columns = wp.min(_COLUMNS, width - left)
    # A row is blurred one turn after it was copied, from the other half of the lines: reads that straddle
    # two vectors which were just written would have to wait for both to reach the cache.
    for turn in range(_HALO_ROWS + 1):
        half = (turn & 1) * _LINES_5
        source = base + (turn - _REACH) * pitch - _REACH
        image_line = floats_from(image, source, _LINE)
        target_line = floats_from(target, source, _LINE)
        for i in range(_LINE):
            x = image_line[i]
            y = target_line[i]
            line[half + i] = x
            line[half + _LINE + i] = y
            line[half + 2 * _LINE + i] = x * x
            line[half + 3 * _LINE + i] = y * y
            line[half + 4 * _LINE + i] = x * y
        if turn > 0:
            for moment in range(5):
                o = _LINES_5 - half + moment * _LINE
                b = moment * _MAP + (turn - 1) * _COLUMNS
                for c in range(_COLUMNS):
                    blur[b + c] = window_sum(
                        line[o + c] + line[o + c + 10],
                        line[o + c + 1] + line[o + c + 9],
                        line[o + c + 2] + line[o + c + 8],
                        line[o + c + 3] + line[o + c + 7],
                        line[o + c + 4] + line[o + c + 6],
                        line[o + c + 5],
                    )
    total_l1 = float(0.0)
    total_dssim = float(0.0)
    for row in range(wp.min(_ROWS, height - top)):
        for moment_v in range(5):
            p = moment_v * _MAP + row * _COLUMNS
            m = moment_v * _LINE
            for cv in range(_COLUMNS):
                line[m + cv] = window_sum(
                    blur[p + cv] + blur[p + 10 * _COLUMNS + cv],
                    blur[p + _COLUMNS + cv] + blur[p + 9 * _COLUMNS + cv],
                    blur[p + 2 * _COLUMNS + cv] + blur[p + 8 * _COLUMNS + cv],
                    blur[p + 3 * _COLUMNS + cv] + blur[p + 7 * _COLUMNS + cv],
                    blur[p + 4 * _COLUMNS + cv] + blur[p + 6 * _COLUMNS + cv],
                    blur[p + 5 * _COLUMNS + cv],
                )
        # From moments to SSIM and its derivatives, in place: a loop of fixed length, so that it is
        # vectorized, and only then the pixels that exist are written.
        for col in range(_COLUMNS):
            mean_x = line[col]
            mean_y = line[_LINE + col]
            a = 2.0 * mean_x * mean_y + _C1
            s = 2.0 * (line[4 * _LINE + col] - mean_x * mean_y) + _C2
            d = mean_x * mean_x + mean_y * mean_y + _C1
            e = line[2 * _LINE + col] + line[3 * _LINE + col] - (d - _C1) + _C2
            inverse = 1.0 / (d * e)
            ssim = a * s * inverse
            g_xx = -ssim * d * inverse
            g_xy = 2.0 * a * inverse
            line[col] = (
                2.0 * (mean_y * s * inverse - mean_x * ssim * e * inverse)
                - 2.0 * mean_x * g_xx
                - mean_y * g_xy
            )
            line[_LINE + col] = g_xx
            line[2 * _LINE + col] = g_xy
            line[3 * _LINE + col] = 1.0 - ssim
        # The fifth line is free now: it takes the weights of the row.
        for one in range(_COLUMNS):
            line[4 * _LINE + one] = 1.0
        if weighted != 0:
            weight_row = (origin + (top + row) * pitch + left) & _NOT_NEGATIVE
            for w in range(columns):
                line[4 * _LINE + w] = weights[weight_row + w]
        pixel = base + row * pitch
        image_row = floats_from(image, pixel, _COLUMNS)
        target_row = floats_from(target, pixel, _COLUMNS)
        for col_w in range(_COLUMNS):
            weight = line[4 * _LINE + col_w]
            line[col_w] = weight * line[col_w]
            line[_LINE + col_w] = weight * line[_LINE + col_w]
            line[2 * _LINE + col_w] = weight * line[2 * _LINE + col_w]
            line[3 * _LINE + col_w] = weight * line[3 * _LINE + col_w]
            line[4 * _LINE + col_w] = weight * wp.abs(image_row[col_w] - target_row[col_w])
        for map_out in range(3):
            out_row = floats_from(maps, pixel + 3 * map_out * plane, columns)
            if columns == _COLUMNS:
                for out in range(_COLUMNS):
                    out_row[out] = line[map_out * _LINE + out]
            else:
                for out_t in range(columns):
                    out_row[out_t] = line[map_out * _LINE + out_t]
        row_l1 = float(0.0)
        row_dssim = float(0.0)
        for summed in range(columns):
            row_dssim += line[3 * _LINE + summed]
            row_l1 += line[4 * _LINE + summed]
        total_l1 += row_l1
        total_dssim += row_dssim
    sums[block, 0] = total_l1
    sums[block, 1] = total_dssim


@wp.kernel
def similarity_gradient_kernel(
    first: int,
    blocks_x: int,
    blocks_y: int,
    width: int,
    height: int,
    pitch: int,
    plane: int,
    origin: int,
    active: wp.array[int],  # [blocks_y * blocks_x] not 0 where the gradient is wanted
    image: wp.array[float],
    target: wp.array[float],
    weighted: int,
    weights: wp.array[float],
    maps: wp.array[float],
    l1_weight: float,
    dssim_weight: float,
    # outputs
    adj_image: wp.array[float],  # 3 padded planes
):
    """Write d(l1_weight sum w |x - y| + dssim_weight sum w (1 - SSIM)) / dx of one block of one channel."""
    block = first + wp.tid()
    channel = block // (blocks_x * blocks_y)
    left = (block % blocks_x) * _COLUMNS
    top = (block // blocks_x % blocks_y) * _ROWS
    if active[block % (blocks_x * blocks_y)] == 0:
        return
    line = wp.zeros(shape=(_LINES_4,), dtype=float)
    blur = wp.zeros(shape=(_MAPS_3,), dtype=float)
    for one in range(_COLUMNS):
        line[3 * _LINE + one] = 1.0
    base = origin + channel * plane + top * pitch + left
    columns = wp.min(_COLUMNS, width - left)
    # All maps of a row are copied before the first is blurred, for the reason given above.
    for halo_row in range(_HALO_ROWS):
        source = base + (halo_row - _REACH) * pitch - _REACH
        for copied in range(3):
            map_line = floats_from(maps, source + 3 * copied * plane, _LINE)
            for i in range(_LINE):
                line[copied * _LINE + i] = map_line[i]
        for moment in range(3):
            o = moment * _LINE
            blurred = moment * _MAP + halo_row * _COLUMNS
            for c in range(_COLUMNS):
                blur[blurred + c] = window_sum(
                    line[o + c] + line[o + c + 10],
                    line[o + c + 1] + line[o + c + 9],
                    line[o + c + 2] + line[o + c + 8],
                    line[o + c + 3] + line[o + c + 7],
                    line[o + c + 4] + line[o + c + 6],
                    line[o + c + 5],
                )
    for row in range(wp.min(_ROWS, height - top)):
        for moment_v in range(3):
            p = moment_v * _MAP + row * _COLUMNS
            m = moment_v * _LINE
            for cv in range(_COLUMNS):
                line[m + cv] = window_sum(
                    blur[p + cv] + blur[p + 10 * _COLUMNS + cv],
                    blur[p + _COLUMNS + cv] + blur[p + 9 * _COLUMNS + cv],
                    blur[p + 2 * _COLUMNS + cv] + blur[p + 8 * _COLUMNS + cv],
                    blur[p + 3 * _COLUMNS + cv] + blur[p + 7 * _COLUMNS + cv],
                    blur[p + 4 * _COLUMNS + cv] + blur[p + 6 * _COLUMNS + cv],
                    blur[p + 5 * _COLUMNS + cv],
                )
        if weighted != 0:
            weight_row = (origin + (top + row) * pitch + left) & _NOT_NEGATIVE
            for w in range(columns):
                line[3 * _LINE + w] = weights[weight_row + w]
        pixel = base + row * pitch
        image_row = floats_from(image, pixel, _COLUMNS)
        target_row = floats_from(target, pixel, _COLUMNS)
        for col in range(_COLUMNS):
            x = image_row[col]
            y = target_row[col]
            d_ssim = line[col] + 2.0 * x * line[_LINE + col] + y * line[2 * _LINE + col]
            sign = wp.where(x > y, 1.0, wp.where(x < y, -1.0, 0.0))
            line[col] = l1_weight * line[3 * _LINE + col] * sign - dssim_weight * d_ssim
        out_row = floats_from(adj_image, pixel, columns)
        if columns == _COLUMNS:
            for out in range(_COLUMNS):
                out_row[out] = line[out]
        else:
            for out_t in range(columns):
                out_row[out_t] = line[out_t]
