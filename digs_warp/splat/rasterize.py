# type: ignore
# (device code, which Warp's stubs do not type)
"""Compositing on the CPU: one Warp thread per 16x16 tile, inner loops that LLVM turns into vector code.

Per pixel, front to back over the splats i of its tile (3DGS):

    alpha_i = min(max_alpha, o_i exp(-q_i / 2)),  not drawn below min_alpha
    w_i     = T alpha_i,   C += w_i c_i,   T <- T (1 - alpha_i),  stop before T falls under min_transmittance
    image   = C + T background

With depths z_i and normals n_i, the expected depth is (sum w_i z_i) / (sum w_i), the median depth is the z_i
at which T passes 1/2, and the normal is sum w_i n_i.

The backward pass walks the same list in the same order. With v = dL/dimage and
S = sum of what splat i and those behind it (and the background) still add to v . image,

    S <- S - T alpha_i (c_i . v),   dL/dalpha_i = T (c_i . v) - S / (1 - alpha_i)

Depth and normals enter as further channels of c and v. For the expected depth E with gradient e, the channel
sum w_i z_i has v = e / (1 - T), and T receives e E / (1 - T).

No division by a vanishing transmittance, and no reversed list. Each (tile, splat) pair owns one record of
partial gradients: threads never share an address, so the result is the same for any number of them.

What keeps the inner loops fast: no libm calls, no branches (`wp.where`), no variable name used in two
loops, and all pixel state of a tile, copies of its gradient planes included, in few local arrays (with five
of them LLVM gives up; a read from a Warp array, whose stride is known only at run time, becomes a gather).
The options are constants of the kernel, and what a view does not ask for is not in it: there is one kernel
per set of options.
A test compiles this file with LLVM's vectorization remarks on and fails when a loop falls out.
"""

from functools import cache

import warp as wp

from digs_warp.kernel_options import vector_module_options
from digs_warp.splat.config import (
    TILE_PIXELS,
    TILE_SIZE,
    RasterOptions,
    vector_lanes,
)
from digs_warp.splat.footprint import ViewParams
from digs_warp.splat.records import (
    SPLAT_A,
    SPLAT_B,
    SPLAT_BLUE,
    SPLAT_C,
    SPLAT_GREEN,
    SPLAT_HALF_HEIGHT,
    SPLAT_HALF_WIDTH,
    SPLAT_OPACITY,
    SPLAT_RED,
    SPLAT_U,
    SPLAT_V,
    GradientLayout,
)

wp.set_module_options({"enable_backward": False})

_TILE = wp.constant(TILE_SIZE)
_PIXELS = wp.constant(TILE_PIXELS)
# Columns are walked in groups of one vector.
_LANES = wp.constant(vector_lanes())
_GROUP_MASK = wp.constant(TILE_SIZE // vector_lanes() - 1)
# y & 15 is y, and tells LLVM that it is no negative index, which Warp would have to wrap: without it a
# third of the time of a row goes into index checks.
_ROW_MASK = wp.constant(TILE_SIZE - 1)
# Offsets of the channels in a tile's local array of the forward pass.
_GREEN = wp.constant(TILE_PIXELS)
_BLUE = wp.constant(2 * TILE_PIXELS)
_DEPTH = wp.constant(3 * TILE_PIXELS)
_MEDIAN = wp.constant(4 * TILE_PIXELS)
_NORMAL_X = wp.constant(5 * TILE_PIXELS)
_NORMAL_Y = wp.constant(6 * TILE_PIXELS)
_NORMAL_Z = wp.constant(7 * TILE_PIXELS)
# The backward pass sums a splat's gradient by pixel column first: one vector addition a row, where a
# scalar sum a row would cost a horizontal reduction. Offsets of d_power * dy, * dy^2, red, green, blue,
# depth, normal, and the absolute values of the gradient in u and v.
_LANE_Y = wp.constant(TILE_SIZE)
_LANE_YY = wp.constant(2 * TILE_SIZE)
_LANE_R = wp.constant(3 * TILE_SIZE)
_LANE_G = wp.constant(4 * TILE_SIZE)
_LANE_B = wp.constant(5 * TILE_SIZE)
_LANE_DEPTH = wp.constant(6 * TILE_SIZE)
_LANE_NX = wp.constant(7 * TILE_SIZE)
_LANE_NY = wp.constant(8 * TILE_SIZE)
_LANE_NZ = wp.constant(9 * TILE_SIZE)
_LANE_AU = wp.constant(10 * TILE_SIZE)
_LANE_AV = wp.constant(11 * TILE_SIZE)
# Offsets in a tile's local array of the backward pass: transmittance so far, S, and the v of each channel.
_AHEAD = wp.constant(TILE_PIXELS)
_ADJ_R = wp.constant(2 * TILE_PIXELS)
_ADJ_G = wp.constant(3 * TILE_PIXELS)
_ADJ_B = wp.constant(4 * TILE_PIXELS)
_ADJ_DEPTH = wp.constant(5 * TILE_PIXELS)
_ADJ_NX = wp.constant(6 * TILE_PIXELS)
_ADJ_NY = wp.constant(7 * TILE_PIXELS)
_ADJ_NZ = wp.constant(8 * TILE_PIXELS)
# Coefficients of the polynomial for exp(x / 8): the powers of 1/8 are part of them.
_EXP_1 = wp.constant(0.999999642 / 8.0)
_EXP_2 = wp.constant(0.499992251 / 8.0**2)
_EXP_3 = wp.constant(0.166607097 / 8.0**3)
_EXP_4 = wp.constant(0.0414446555 / 8.0**4)
_EXP_5 = wp.constant(0.0078991186 / 8.0**5)
_EXP_6 = wp.constant(0.000950381975 / 8.0**6)
# Whether a tile is saturated is looked up once every so many splats: a sum over its 256 pixels.
_CHECK_EVERY = wp.constant(8)
# Saturated rows are looked for when the transmittances of a tile sum to less than this: of its 256 pixels.
_CROWDED = wp.constant(TILE_PIXELS / 4.0)


@wp.func
def exp_in_range(x: float) -> float:
    """exp(x) for -5.55 <= x <= 0 (where alpha can reach 1/255), relative error below 2e-6.

    (p(x/8))^8 with a minimax polynomial of degree 6; below the range it stays under 1/255.
    """
    y = wp.max(x, -6.0)
    p = _EXP_4 + y * (_EXP_5 + y * _EXP_6)
    p = 1.0 + y * (_EXP_1 + y * (_EXP_2 + y * (_EXP_3 + y * p)))
    p = p * p
    p = p * p
    return p * p


@cache
def forward_kernel(options: RasterOptions) -> wp.Kernel:
    """Return the kernel that composites one tile."""
    with_depth, with_normals = options.has_depth, options.has_normals
    min_alpha, max_alpha = options.min_alpha, options.max_alpha
    least = options.min_transmittance
    channels = 8 if with_normals else 5 if with_depth else 3
    name = "forward_normals" if with_normals else "forward_depth" if with_depth else "forward_color"

    @wp.kernel(name=name, module="unique", module_options=vector_module_options())
    def forward(
        first: int,
        views: wp.array[ViewParams],  # [1]
        pitch: int,  # floats from one image row to the next
        plane: int,  # floats from one channel to the next
        origin: int,  # index of pixel (0, 0)
        splats: wp.array2d[float],  # [n, SPLAT_FIELDS]
        depths: wp.array[float],  # [n]
        normals: wp.array[wp.vec3],  # [n] in the camera
        tile_starts: wp.array[int],  # [tiles + 1]
        tile_splats: wp.array[int],  # [pairs]
        background: wp.array[float],  # [3]
        # outputs
        image: wp.array[float],  # 3 padded planes
        transmittance: wp.array[float],  # 1 padded plane
        depth_planes: wp.array[float],  # 2 padded planes: expected and median
        normal_planes: wp.array[float],  # 3 padded planes
        tile_ends: wp.array[int],  # [tiles] one past the last pair that any pixel drew
    ):
        """Composite one tile."""
        tile = first + wp.tid()
        columns = views[0].columns
        tile_column = tile % columns
        tile_row = tile // columns
        if tile_row < views[0].first_row or tile_row >= views[0].end_row:
            return
        if tile_column < views[0].first_column or tile_column >= views[0].end_column:
            return
        width = views[0].width
        height = views[0].height
        tile_x = tile_column * _TILE
        tile_y = tile_row * _TILE
        # A saturated pixel has working = 0 for good; final = 1 - sum of weights keeps its transmittance.
        # (Selecting the old value instead would cost the vectorization of the loop.)
        working = wp.zeros(shape=(_PIXELS,), dtype=float)
        final = wp.zeros(shape=(_PIXELS,), dtype=float)
        color = wp.zeros(shape=(wp.static(channels * TILE_PIXELS),), dtype=float)
        for p in range(_PIXELS):
            working[p] = 1.0
            final[p] = 1.0
        begin = tile_starts[tile]
        end = tile_starts[tile + 1]
        stop = end
        low = int(0)  # rows above low and below high are saturated
        high = int(15)
        for k in range(begin, end):
            if (k - begin) % _CHECK_EVERY == _CHECK_EVERY - 1:
                alive = float(0.0)
                for r in range(_PIXELS):
                    alive += working[r]
                if alive == 0.0:
                    stop = k
                    break
                if alive < _CROWDED:
                    low = int(_TILE)
                    high = int(-1)
                    for r_row in range(_TILE):
                        alive_row = float(0.0)
                        for r_x in range(_TILE):
                            alive_row += working[r_row * _TILE + r_x]
                        if alive_row > 0.0:
                            low = wp.min(low, r_row)
                            high = r_row
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
            z = float(0.0)
            normal = wp.vec3(0.0, 0.0, 0.0)
            if wp.static(with_depth):
                z = depths[g]
            if wp.static(with_normals):
                normal = normals[g]
            # Clamped as floats: a huge splat would overflow an integer.
            y_first = int(wp.max(wp.ceil(mean_y - half_height), float(low)))
            y_last = int(wp.min(wp.floor(mean_y + half_height), float(high)))
            half_width = splats[g, SPLAT_HALF_WIDTH]
            x_first = int(wp.max(wp.ceil(mean_x - half_width), 0.0)) // _LANES
            x_last = int(wp.min(wp.floor(mean_x + half_width), 15.0)) // _LANES
            for group in range(x_first, x_last + 1):
                left = float(group * _LANES) - mean_x
                column = (group & _GROUP_MASK) * _LANES
                for y in range(y_first, y_last + 1):
                    dy = float(y) - mean_y
                    e0 = -0.5 * c * dy * dy
                    e1 = -b * dy
                    row = (y & _ROW_MASK) * _TILE + column
                    for x in range(_LANES):
                        dx = float(x) + left
                        power = wp.min(e0 + dx * (e1 - 0.5 * a * dx), 0.0)
                        alpha = wp.min(opacity * exp_in_range(power), wp.static(max_alpha))
                        alpha = wp.where(alpha >= wp.static(min_alpha), alpha, 0.0)
                        before = working[row + x]
                        after = before - before * alpha
                        weight = wp.where(after >= wp.static(least), alpha * before, 0.0)
                        working[row + x] = wp.where(after >= wp.static(least), after, 0.0)
                        if wp.static(with_depth):
                            color[_DEPTH + row + x] = color[_DEPTH + row + x] + weight * z
                            passed = wp.where(final[row + x] > 0.5, z, 0.0)
                            passed = wp.where(final[row + x] - weight <= 0.5, passed, 0.0)
                            color[_MEDIAN + row + x] = color[_MEDIAN + row + x] + passed
                        if wp.static(with_normals):
                            color[_NORMAL_X + row + x] = (
                                color[_NORMAL_X + row + x] + weight * normal[0]
                            )
                            color[_NORMAL_Y + row + x] = (
                                color[_NORMAL_Y + row + x] + weight * normal[1]
                            )
                            color[_NORMAL_Z + row + x] = (
                                color[_NORMAL_Z + row + x] + weight * normal[2]
                            )
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
                if wp.static(with_depth):
                    drawn = 1.0 - final[q]
                    depth_planes[start + xx] = wp.where(drawn > 0.0, color[_DEPTH + q] / drawn, 0.0)
                    depth_planes[start + plane + xx] = color[_MEDIAN + q]
                if wp.static(with_normals):
                    normal_planes[start + xx] = color[_NORMAL_X + q]
                    normal_planes[start + plane + xx] = color[_NORMAL_Y + q]
                    normal_planes[start + 2 * plane + xx] = color[_NORMAL_Z + q]

    return forward


@cache
def backward_kernel(options: RasterOptions, with_absolute: bool) -> wp.Kernel:
    """Return the kernel that writes the gradient records of one tile.

    ``with_absolute`` adds the sums of the absolute values of the gradient in u and v (AbsGS).
    """
    with_depth, with_normals = options.has_depth, options.has_normals
    min_alpha, max_alpha = options.min_alpha, options.max_alpha
    least = options.min_transmittance
    layout = GradientLayout.of(with_depth, with_normals, with_absolute)
    planes = 9 if with_normals else 6 if with_depth else 5
    lane_count = 12 if with_absolute else 10 if with_normals else 7 if with_depth else 6
    name = (
        "backward_normals" if with_normals else "backward_depth" if with_depth else "backward_color"
    )
    name += "_absolute" if with_absolute else ""

    @wp.kernel(name=name, module="unique", module_options=vector_module_options())
    def backward(
        first: int,
        views: wp.array[ViewParams],
        pitch: int,
        plane: int,
        origin: int,
        splats: wp.array2d[float],
        depths: wp.array[float],
        normals: wp.array[wp.vec3],
        tile_starts: wp.array[int],
        tile_splats: wp.array[int],
        image: wp.array[float],
        transmittance: wp.array[float],
        depth_planes: wp.array[float],
        normal_planes: wp.array[float],
        tile_ends: wp.array[int],
        adj_image: wp.array[float],  # 3 padded planes, zero outside the image
        adj_transmittance: wp.array[float],  # 1 padded plane, zero outside the image
        adj_depth: wp.array[float],  # 1 padded plane, zero outside the image
        adj_normals: wp.array[float],  # 3 padded planes, zero outside the image
        # outputs
        pair_gradients: wp.array2d[float],  # [pairs, fields of the layout]
    ):
        """Write the gradient records of one tile; re-reads what the forward pass wrote."""
        tile = first + wp.tid()
        columns = views[0].columns
        tile_column = tile % columns
        tile_row = tile // columns
        if tile_row >= views[0].rows:
            return
        tile_x = tile_column * _TILE
        tile_y = tile_row * _TILE
        start = origin + tile_y * pitch + tile_x
        begin = tile_starts[tile]
        end = tile_starts[tile + 1]
        if begin == end:
            return
        # Transmittance so far, then S of the module docstring, then v.
        state = wp.zeros(shape=(wp.static(planes * TILE_PIXELS),), dtype=float)
        lanes = wp.zeros(shape=(wp.static(lane_count * TILE_SIZE),), dtype=float)
        for yy in range(_TILE):
            base = start + yy * pitch
            for xx in range(_TILE):
                p = base + xx
                q = yy * _TILE + xx
                adj_r = adj_image[p]
                adj_g = adj_image[plane + p]
                adj_b = adj_image[2 * plane + p]
                ahead = image[p] * adj_r + image[plane + p] * adj_g + image[2 * plane + p] * adj_b
                ahead += transmittance[p] * adj_transmittance[p]
                if wp.static(with_depth):
                    through = transmittance[p]
                    adj_sum = wp.where(through < 1.0, adj_depth[p] / (1.0 - through), 0.0)
                    # T e E / (1 - T) for the transmittance, and sum w z . v = e E for the sum.
                    ahead += depth_planes[p] * adj_sum
                    state[_ADJ_DEPTH + q] = adj_sum
                if wp.static(with_normals):
                    adj_x = adj_normals[p]
                    adj_y = adj_normals[plane + p]
                    adj_z = adj_normals[2 * plane + p]
                    ahead += normal_planes[p] * adj_x + normal_planes[plane + p] * adj_y
                    ahead += normal_planes[2 * plane + p] * adj_z
                    state[_ADJ_NX + q] = adj_x
                    state[_ADJ_NY + q] = adj_y
                    state[_ADJ_NZ + q] = adj_z
                state[q] = 1.0
                state[_AHEAD + q] = ahead
                state[_ADJ_R + q] = adj_r
                state[_ADJ_G + q] = adj_g
                state[_ADJ_B + q] = adj_b
        stop = tile_ends[tile]
        low = int(0)
        high = int(15)
        for k in range(begin, stop):
            if (k - begin) % _CHECK_EVERY == _CHECK_EVERY - 1:
                alive = float(0.0)
                for r in range(_PIXELS):
                    alive += state[r]
                if alive < _CROWDED:
                    low = int(_TILE)
                    high = int(-1)
                    for r_row in range(_TILE):
                        alive_row = float(0.0)
                        for r_x in range(_TILE):
                            alive_row += state[r_row * _TILE + r_x]
                        if alive_row > 0.0:
                            low = wp.min(low, r_row)
                            high = r_row
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
            z = float(0.0)
            normal = wp.vec3(0.0, 0.0, 0.0)
            if wp.static(with_depth):
                z = depths[g]
            if wp.static(with_normals):
                normal = normals[g]
            y_first = int(wp.max(wp.ceil(mean_y - half_height), float(low)))
            y_last = int(wp.min(wp.floor(mean_y + half_height), float(high)))
            half_width = splats[g, SPLAT_HALF_WIDTH]
            x_first = int(wp.max(wp.ceil(mean_x - half_width), 0.0)) // _LANES
            x_last = int(wp.min(wp.floor(mean_x + half_width), 15.0)) // _LANES
            for lane_z in range(wp.static(lane_count * TILE_SIZE)):
                lanes[lane_z] = 0.0
            for group in range(x_first, x_last + 1):
                left = float(group * _LANES) - mean_x
                column = (group & _GROUP_MASK) * _LANES
                for y in range(y_first, y_last + 1):
                    dy = float(y) - mean_y
                    e0 = -0.5 * c * dy * dy
                    e1 = -b * dy
                    row = (y & _ROW_MASK) * _TILE + column
                    for x in range(_LANES):
                        dx = float(x) + left
                        power = wp.min(e0 + dx * (e1 - 0.5 * a * dx), 0.0)
                        raw = opacity * exp_in_range(power)
                        alpha = wp.min(raw, wp.static(max_alpha))
                        alpha = wp.where(alpha >= wp.static(min_alpha), alpha, 0.0)
                        before = state[row + x]
                        after = before - before * alpha
                        weight = wp.where(after >= wp.static(least), alpha * before, 0.0)
                        state[row + x] = wp.where(after >= wp.static(least), after, 0.0)
                        v_r = state[_ADJ_R + row + x]
                        v_g = state[_ADJ_G + row + x]
                        v_b = state[_ADJ_B + row + x]
                        shine = color_r * v_r + color_g * v_g + color_b * v_b
                        if wp.static(with_depth):
                            v_d = state[_ADJ_DEPTH + row + x]
                            shine = shine + z * v_d
                            lanes[_LANE_DEPTH + column + x] = (
                                lanes[_LANE_DEPTH + column + x] + weight * v_d
                            )
                        if wp.static(with_normals):
                            v_x = state[_ADJ_NX + row + x]
                            v_y = state[_ADJ_NY + row + x]
                            v_z = state[_ADJ_NZ + row + x]
                            shine = shine + normal[0] * v_x + normal[1] * v_y + normal[2] * v_z
                            lanes[_LANE_NX + column + x] = (
                                lanes[_LANE_NX + column + x] + weight * v_x
                            )
                            lanes[_LANE_NY + column + x] = (
                                lanes[_LANE_NY + column + x] + weight * v_y
                            )
                            lanes[_LANE_NZ + column + x] = (
                                lanes[_LANE_NZ + column + x] + weight * v_z
                            )
                        rest = state[_AHEAD + row + x] - weight * shine
                        state[_AHEAD + row + x] = rest
                        d_alpha = before * shine - rest / (1.0 - alpha)
                        # d_alpha * alpha = dL/dpower; zero where capped, cut, or stopped
                        moving = wp.where(raw <= wp.static(max_alpha), alpha, 0.0)
                        d_power = wp.where(after >= wp.static(least), d_alpha * moving, 0.0)
                        if wp.static(with_absolute):
                            d_u = wp.abs(d_power * (a * dx + b * dy))
                            d_v = wp.abs(d_power * (b * dx + c * dy))
                            lanes[_LANE_AU + column + x] = lanes[_LANE_AU + column + x] + d_u
                            lanes[_LANE_AV + column + x] = lanes[_LANE_AV + column + x] + d_v
                        lanes[column + x] = lanes[column + x] + d_power
                        lanes[_LANE_Y + column + x] = lanes[_LANE_Y + column + x] + d_power * dy
                        lanes[_LANE_YY + column + x] = (
                            lanes[_LANE_YY + column + x] + d_power * dy * dy
                        )
                        lanes[_LANE_R + column + x] = lanes[_LANE_R + column + x] + weight * v_r
                        lanes[_LANE_G + column + x] = lanes[_LANE_G + column + x] + weight * v_g
                        lanes[_LANE_B + column + x] = lanes[_LANE_B + column + x] + weight * v_b
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
            if wp.static(with_depth):
                sum_depth = float(0.0)
                for lane_d in range(_TILE):
                    sum_depth += lanes[_LANE_DEPTH + lane_d]
                pair_gradients[k, wp.static(layout.depth)] = sum_depth
            if wp.static(with_normals):
                sum_nx = float(0.0)
                sum_ny = float(0.0)
                sum_nz = float(0.0)
                for lane_n in range(_TILE):
                    sum_nx += lanes[_LANE_NX + lane_n]
                    sum_ny += lanes[_LANE_NY + lane_n]
                    sum_nz += lanes[_LANE_NZ + lane_n]
                pair_gradients[k, wp.static(layout.normal)] = sum_nx
                pair_gradients[k, wp.static(layout.normal + 1)] = sum_ny
                pair_gradients[k, wp.static(layout.normal + 2)] = sum_nz
            if wp.static(with_absolute):
                sum_au = float(0.0)
                sum_av = float(0.0)
                for lane_a in range(_TILE):
                    sum_au += lanes[_LANE_AU + lane_a]
                    sum_av += lanes[_LANE_AV + lane_a]
                pair_gradients[k, wp.static(layout.absolute)] = sum_au
                pair_gradients[k, wp.static(layout.absolute + 1)] = sum_av
        for rest_k in range(stop, end):
            for field in range(wp.static(layout.fields)):
                pair_gradients[rest_k, field] = 0.0

    return backward
