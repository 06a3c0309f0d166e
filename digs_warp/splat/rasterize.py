# type: ignore
# (device code, which Warp's stubs do not type)
"""Compositing on the CPU: one Warp thread per 16x16 tile, inner loops that LLVM turns into vector code.

Per pixel, front to back over the splats i of its tile (3DGS):

    alpha_i = min(MAX_ALPHA, o_i exp(-q_i / 2)),  not drawn below MIN_ALPHA
    C      += T alpha_i c_i,   T <- T (1 - alpha_i),  stop before T falls under MIN_TRANSMITTANCE
    image   = C + T background

The backward pass walks the same list in the same order. With v = dL/dimage and
S = sum of what splat i and those behind it (and the background) still add to v . image,

    S <- S - T alpha_i (c_i . v),   dL/dalpha_i = T (c_i . v) - S / (1 - alpha_i)

No division by a vanishing transmittance, and no reversed list. Each (tile, splat) pair owns one record of
nine partial gradients: threads never share an address, so the result is the same for any number of them.

What keeps the inner loops fast: no libm calls, no branches (`wp.where`), no variable name used in two
loops, and all pixel state of a tile, copies of its gradient planes included, in few local arrays (with five
of them LLVM gives up; a read from a Warp array, whose stride is known only at run time, becomes a gather).
A test compiles this file with LLVM's vectorization remarks on and fails when a loop falls out.
"""

import warp as wp

from digs_warp.splat.config import (
    MAX_ALPHA,
    MIN_ALPHA,
    MIN_TRANSMITTANCE,
    TILE_PIXELS,
    TILE_SIZE,
    raster_module_options,
)
from digs_warp.splat.project import (
    SPLAT_A,
    SPLAT_B,
    SPLAT_BLUE,
    SPLAT_C,
    SPLAT_GREEN,
    SPLAT_HALF_HEIGHT,
    SPLAT_OPACITY,
    SPLAT_RED,
    SPLAT_U,
    SPLAT_V,
)

wp.set_module_options(raster_module_options())

_TILE = wp.constant(TILE_SIZE)
_PIXELS = wp.constant(TILE_PIXELS)
# y & 15 is y, and tells LLVM that it is no negative index, which Warp would have to wrap: without it a
# third of the time of a row goes into index checks.
_ROW_MASK = wp.constant(TILE_SIZE - 1)
# Offsets of the channels in a tile's local colour array.
_GREEN = wp.constant(TILE_PIXELS)
_BLUE = wp.constant(2 * TILE_PIXELS)
_COLORS = wp.constant(3 * TILE_PIXELS)
# The backward pass sums a splat's gradient by pixel column first: one vector addition a row, where a
# scalar sum a row would cost a horizontal reduction. Offsets of d_power * dy, * dy^2, red, green, blue.
_LANE_Y = wp.constant(TILE_SIZE)
_LANE_YY = wp.constant(2 * TILE_SIZE)
_LANE_R = wp.constant(3 * TILE_SIZE)
_LANE_G = wp.constant(4 * TILE_SIZE)
_LANE_B = wp.constant(5 * TILE_SIZE)
_LANES = wp.constant(6 * TILE_SIZE)
_AHEAD = wp.constant(TILE_PIXELS)
_ADJ_R = wp.constant(2 * TILE_PIXELS)
_ADJ_G = wp.constant(3 * TILE_PIXELS)
_ADJ_B = wp.constant(4 * TILE_PIXELS)
_STATE = wp.constant(5 * TILE_PIXELS)
_MIN_ALPHA = wp.constant(MIN_ALPHA)
_MAX_ALPHA = wp.constant(MAX_ALPHA)
_STOP = wp.constant(MIN_TRANSMITTANCE)
# Whether a tile is saturated is looked up once every so many splats: a sum over its 256 pixels.
_CHECK_EVERY = wp.constant(8)


@wp.func
def exp_in_range(x: float) -> float:
    """exp(x) for -5.55 <= x <= 0 (where alpha can reach MIN_ALPHA), relative error below 2e-6.

    (p(x/8))^8 with a minimax polynomial of degree 6; below the range it stays under MIN_ALPHA.
    """
    y = wp.max(x, -6.0) * 0.125
    p = 0.0414446555 + y * (0.0078991186 + y * 0.000950381975)
    p = 1.0 + y * (0.999999642 + y * (0.499992251 + y * (0.166607097 + y * p)))
    p = p * p
    p = p * p
    return p * p


@wp.kernel
def forward_kernel(
    first: int,
    columns: int,
    width: int,
    height: int,
    pitch: int,  # floats from one image row to the next
    plane: int,  # floats from one channel to the next
    origin: int,  # index of pixel (0, 0)
    splats: wp.array2d[float],  # [n, SPLAT_FIELDS]
    tile_starts: wp.array[int],  # [tiles + 1]
    tile_splats: wp.array[int],  # [pairs]
    background: wp.array[float],  # [3]
    # outputs
    image: wp.array[float],  # 3 padded planes
    transmittance: wp.array[float],  # 1 padded plane
    tile_ends: wp.array[int],  # [tiles] one past the last pair that any pixel drew
):
    """Composite one tile."""
    tile = first + wp.tid()
    tile_x = (tile % columns) * _TILE
    tile_y = (tile // columns) * _TILE
    # A saturated pixel has working = 0 for good; final = 1 - sum of weights keeps its transmittance.
    # (Selecting the old value instead would cost the vectorization of the loop.)
    working = wp.zeros(shape=(_PIXELS,), dtype=float)
    final = wp.zeros(shape=(_PIXELS,), dtype=float)
    color = wp.zeros(shape=(_COLORS,), dtype=float)
    for p in range(_PIXELS):
        working[p] = 1.0
        final[p] = 1.0
    begin = tile_starts[tile]
    end = tile_starts[tile + 1]
    stop = end
    for k in range(begin, end):
        if (k - begin) % _CHECK_EVERY == _CHECK_EVERY - 1:
            alive = float(0.0)
            for r in range(_PIXELS):
                alive += working[r]
            if alive == 0.0:
                stop = k
                break
        g = tile_splats[k]
        mean_x = splats[g, SPLAT_U] - float(tile_x) - 0.5
        mean_y = splats[g, SPLAT_V] - float(tile_y) - 0.5
        a = splats[g, SPLAT_A]
        b = splats[g, SPLAT_B]
        c = splats[g, SPLAT_C]
        opacity = splats[g, SPLAT_OPACITY]
        color_r = splats[g, SPLAT_RED]
        color_g = splats[g, SPLAT_GREEN]
        color_b = splats[g, SPLAT_BLUE]
        half_height = splats[g, SPLAT_HALF_HEIGHT]
        # Clamped as floats: a huge splat would overflow an integer.
        y_first = int(wp.max(wp.ceil(mean_y - half_height), 0.0))
        y_last = int(wp.min(wp.floor(mean_y + half_height), 15.0))
        for y in range(y_first, y_last + 1):
            dy = float(y) - mean_y
            row = (y & _ROW_MASK) * _TILE
            e0 = -0.5 * c * dy * dy
            e1 = -b * dy
            for x in range(_TILE):
                dx = float(x) - mean_x
                power = wp.min(e0 + dx * (e1 - 0.5 * a * dx), 0.0)
                alpha = wp.min(opacity * exp_in_range(power), _MAX_ALPHA)
                alpha = wp.where(alpha >= _MIN_ALPHA, alpha, 0.0)
                before = working[row + x]
                after = before * (1.0 - alpha)
                weight = wp.where(after >= _STOP, alpha * before, 0.0)
                working[row + x] = wp.where(after >= _STOP, after, 0.0)
                final[row + x] = final[row + x] - weight
                color[row + x] = color[row + x] + weight * color_r
                color[_GREEN + row + x] = color[_GREEN + row + x] + weight * color_g
                color[_BLUE + row + x] = color[_BLUE + row + x] + weight * color_b
    tile_ends[tile] = stop
    back_r = background[0]
    back_g = background[1]
    back_b = background[2]
    for yy in range(wp.min(_TILE, height - tile_y)):
        start = origin + (tile_y + yy) * pitch + tile_x
        for xx in range(wp.min(_TILE, width - tile_x)):
            q = yy * _TILE + xx
            image[start + xx] = color[q] + final[q] * back_r
            image[start + plane + xx] = color[_GREEN + q] + final[q] * back_g
            image[start + 2 * plane + xx] = color[_BLUE + q] + final[q] * back_b
            transmittance[start + xx] = final[q]


@wp.kernel
def backward_kernel(
    first: int,
    columns: int,
    pitch: int,
    plane: int,
    origin: int,
    splats: wp.array2d[float],
    tile_starts: wp.array[int],
    tile_splats: wp.array[int],
    image: wp.array[float],
    transmittance: wp.array[float],
    tile_ends: wp.array[int],
    adj_image: wp.array[float],  # 3 padded planes, zero outside the image
    adj_transmittance: wp.array[float],  # 1 padded plane, zero outside the image
    # outputs
    pair_gradients: wp.array2d[float],  # [pairs, GRADIENT_FIELDS]
):
    """Write the gradient records of one tile; re-reads the forward's image and transmittance."""
    tile = first + wp.tid()
    tile_x = (tile % columns) * _TILE
    tile_y = (tile // columns) * _TILE
    start = origin + tile_y * pitch + tile_x
    begin = tile_starts[tile]
    end = tile_starts[tile + 1]
    if begin == end:
        return
    # Transmittance so far, then S of the module docstring.
    state = wp.zeros(shape=(_STATE,), dtype=float)
    lanes = wp.zeros(shape=(_LANES,), dtype=float)  # column sums of one splat
    for yy in range(_TILE):
        base = start + yy * pitch
        for xx in range(_TILE):
            p = base + xx
            q = yy * _TILE + xx
            adj_r = adj_image[p]
            adj_g = adj_image[plane + p]
            adj_b = adj_image[2 * plane + p]
            state[q] = 1.0
            state[_AHEAD + q] = (
                image[p] * adj_r
                + image[plane + p] * adj_g
                + image[2 * plane + p] * adj_b
                + transmittance[p] * adj_transmittance[p]
            )
            state[_ADJ_R + q] = adj_r
            state[_ADJ_G + q] = adj_g
            state[_ADJ_B + q] = adj_b
    stop = tile_ends[tile]
    for k in range(begin, stop):
        g = tile_splats[k]
        mean_x = splats[g, SPLAT_U] - float(tile_x) - 0.5
        mean_y = splats[g, SPLAT_V] - float(tile_y) - 0.5
        a = splats[g, SPLAT_A]
        b = splats[g, SPLAT_B]
        c = splats[g, SPLAT_C]
        opacity = splats[g, SPLAT_OPACITY]
        color_r = splats[g, SPLAT_RED]
        color_g = splats[g, SPLAT_GREEN]
        color_b = splats[g, SPLAT_BLUE]
        half_height = splats[g, SPLAT_HALF_HEIGHT]
        y_first = int(wp.max(wp.ceil(mean_y - half_height), 0.0))
        y_last = int(wp.min(wp.floor(mean_y + half_height), 15.0))
        for z in range(_LANES):
            lanes[z] = 0.0
        for y in range(y_first, y_last + 1):
            dy = float(y) - mean_y
            row = (y & _ROW_MASK) * _TILE
            e0 = -0.5 * c * dy * dy
            e1 = -b * dy
            for x in range(_TILE):
                dx = float(x) - mean_x
                power = wp.min(e0 + dx * (e1 - 0.5 * a * dx), 0.0)
                raw = opacity * exp_in_range(power)
                alpha = wp.min(raw, _MAX_ALPHA)
                alpha = wp.where(alpha >= _MIN_ALPHA, alpha, 0.0)
                before = state[row + x]
                after = before * (1.0 - alpha)
                weight = wp.where(after >= _STOP, alpha * before, 0.0)
                state[row + x] = wp.where(after >= _STOP, after, 0.0)
                v_r = state[_ADJ_R + row + x]
                v_g = state[_ADJ_G + row + x]
                v_b = state[_ADJ_B + row + x]
                shine = color_r * v_r + color_g * v_g + color_b * v_b
                rest = state[_AHEAD + row + x] - weight * shine
                state[_AHEAD + row + x] = rest
                d_alpha = before * shine - rest / (1.0 - alpha)
                # d_alpha * alpha = dL/dpower; zero where capped, cut, or stopped
                moving = wp.where(raw <= _MAX_ALPHA, alpha, 0.0)
                d_power = wp.where(after >= _STOP, d_alpha * moving, 0.0)
                lanes[x] = lanes[x] + d_power
                lanes[_LANE_Y + x] = lanes[_LANE_Y + x] + d_power * dy
                lanes[_LANE_YY + x] = lanes[_LANE_YY + x] + d_power * dy * dy
                lanes[_LANE_R + x] = lanes[_LANE_R + x] + weight * v_r
                lanes[_LANE_G + x] = lanes[_LANE_G + x] + weight * v_g
                lanes[_LANE_B + x] = lanes[_LANE_B + x] + weight * v_b
        sum_0 = float(0.0)
        sum_x = float(0.0)
        sum_y = float(0.0)
        sum_xx = float(0.0)
        sum_xy = float(0.0)
        sum_yy = float(0.0)
        sum_r = float(0.0)
        sum_g = float(0.0)
        sum_b = float(0.0)
        for lane in range(_TILE):
            offset = float(lane) - mean_x
            sum_0 += lanes[lane]
            sum_x += lanes[lane] * offset
            sum_xx += lanes[lane] * offset * offset
            sum_y += lanes[_LANE_Y + lane]
            sum_xy += lanes[_LANE_Y + lane] * offset
            sum_yy += lanes[_LANE_YY + lane]
            sum_r += lanes[_LANE_R + lane]
            sum_g += lanes[_LANE_G + lane]
            sum_b += lanes[_LANE_B + lane]
        pair_gradients[k, 0] = a * sum_x + b * sum_y
        pair_gradients[k, 1] = b * sum_x + c * sum_y
        pair_gradients[k, 2] = -0.5 * sum_xx
        pair_gradients[k, 3] = -sum_xy
        pair_gradients[k, 4] = -0.5 * sum_yy
        pair_gradients[k, 5] = sum_0 / opacity
        pair_gradients[k, 6] = sum_r
        pair_gradients[k, 7] = sum_g
        pair_gradients[k, 8] = sum_b
    for rest_k in range(stop, end):
        for field in range(9):
            pair_gradients[rest_k, field] = 0.0
