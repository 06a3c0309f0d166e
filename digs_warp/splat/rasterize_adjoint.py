# type: ignore
# (device code, which Warp's stubs do not type)
"""Gradient of the compositing of `digs_warp.splat.rasterize`, where the formulas stand."""

from functools import cache

import warp as wp

from digs_warp.kernel_options import vector_module_options
from digs_warp.splat.config import TILE_PIXELS, TILE_SIZE, RasterOptions
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
from digs_warp.splat.tile import (
    CHECK_EVERY,
    CROWDED,
    GROUP_MASK,
    LANES,
    PIXELS,
    ROW_MASK,
    TILE,
    exp_in_range,
)

wp.set_module_options({"enable_backward": False})

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
        tile_x = tile_column * TILE
        tile_y = tile_row * TILE
        start = origin + tile_y * pitch + tile_x
        begin = tile_starts[tile]
        end = tile_starts[tile + 1]
        if begin == end:
            return
        # Transmittance so far, then S of the module docstring, then v.
        state = wp.zeros(shape=(wp.static(planes * TILE_PIXELS),), dtype=float)
        lanes = wp.zeros(shape=(wp.static(lane_count * TILE_SIZE),), dtype=float)
        for yy in range(TILE):
            base = start + yy * pitch
            for xx in range(TILE):
                p = base + xx
                q = yy * TILE + xx
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
            if (k - begin) % CHECK_EVERY == CHECK_EVERY - 1:
                alive = float(0.0)
                for r in range(PIXELS):
                    alive += state[r]
                if alive < CROWDED:
                    low = int(TILE)
                    high = int(-1)
                    for r_row in range(TILE):
                        alive_row = float(0.0)
                        for r_x in range(TILE):
                            alive_row += state[r_row * TILE + r_x]
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
            x_first = int(wp.max(wp.ceil(mean_x - half_width), 0.0)) // LANES
            x_last = int(wp.min(wp.floor(mean_x + half_width), 15.0)) // LANES
            for lane_z in range(wp.static(lane_count * TILE_SIZE)):
                lanes[lane_z] = 0.0
            for group in range(x_first, x_last + 1):
                left = float(group * LANES) - mean_x
                column = (group & GROUP_MASK) * LANES
                for y in range(y_first, y_last + 1):
                    dy = float(y) - mean_y
                    e0 = -0.5 * c * dy * dy
                    e1 = -b * dy
                    row = (y & ROW_MASK) * TILE + column
                    for x in range(LANES):
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
            for lane in range(TILE):
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
                for lane_d in range(TILE):
                    sum_depth += lanes[_LANE_DEPTH + lane_d]
                pair_gradients[k, wp.static(layout.depth)] = sum_depth
            if wp.static(with_normals):
                sum_nx = float(0.0)
                sum_ny = float(0.0)
                sum_nz = float(0.0)
                for lane_n in range(TILE):
                    sum_nx += lanes[_LANE_NX + lane_n]
                    sum_ny += lanes[_LANE_NY + lane_n]
                    sum_nz += lanes[_LANE_NZ + lane_n]
                pair_gradients[k, wp.static(layout.normal)] = sum_nx
                pair_gradients[k, wp.static(layout.normal + 1)] = sum_ny
                pair_gradients[k, wp.static(layout.normal + 2)] = sum_nz
            if wp.static(with_absolute):
                sum_au = float(0.0)
                sum_av = float(0.0)
                for lane_a in range(TILE):
                    sum_au += lanes[_LANE_AU + lane_a]
                    sum_av += lanes[_LANE_AV + lane_a]
                pair_gradients[k, wp.static(layout.absolute)] = sum_au
                pair_gradients[k, wp.static(layout.absolute + 1)] = sum_av
        for rest_k in range(stop, end):
            for field in range(wp.static(layout.fields)):
                pair_gradients[rest_k, field] = 0.0

    return backward
