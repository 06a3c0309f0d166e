"""Gradient of the compositing of `digs_warp.splat.rasterize`, where the formulas stand."""

from functools import cache

import warp as wp

from digs_warp.device.contiguous import cache_line_at, floats_from
from digs_warp.device.kernel_options import vector_module_options
from digs_warp.splat.config import MIN_TRANSMITTANCE
from digs_warp.splat.records import (
    COLOR_FIELDS,
    Planes,
    Splats,
    TilePairs,
)
from digs_warp.splat.tile import (
    BLOCK,
    BLOCK_COLUMNS,
    BLOCK_ROW_SHIFT,
    BLOCK_SHIFT,
    BLOCKS_MASK,
    COLUMN_MASK,
    GROUP,
    PLANE_FLOATS,
    TILE,
    block_left,
    block_top,
    capped_and_cut,
    exp_in_range,
    lowest_bit,
    planes_memory,
    power_at,
    prefetch_splat,
    slope_in_power,
    tile_splat,
)

wp.set_module_options({"enable_backward": False})

_LEAST = wp.constant(MIN_TRANSMITTANCE)

# The backward pass sums a splat's gradient by the place of a pixel in its block first: one vector addition a
# block, where a scalar sum would cost a horizontal reduction. d_power and d_power * dy are summed for each
# half of the tile, because the sums with dx follow from them. Offsets of the right half, of d_power * dy,
# * dy^2, red, green, blue and depth.
_LANES = 16
_RIGHT = wp.constant(_LANES)
_LANE_Y = wp.constant(2 * _LANES)
_LANE_YY = wp.constant(4 * _LANES)
_LANE_R = wp.constant(5 * _LANES)
_LANE_G = wp.constant(6 * _LANES)
_LANE_B = wp.constant(7 * _LANES)
_LANE_DEPTH = wp.constant(8 * _LANES)
# Planes of a tile: transmittance so far, S, and the v of each channel.
_AHEAD = wp.constant(PLANE_FLOATS)
_ADJ_R = wp.constant(2 * PLANE_FLOATS)
_ADJ_G = wp.constant(3 * PLANE_FLOATS)
_ADJ_B = wp.constant(4 * PLANE_FLOATS)
_ADJ_DEPTH = wp.constant(5 * PLANE_FLOATS)


def usual_kernels() -> list[wp.Kernel]:
    """Return the kernels of a training, for `digs-warp precompile`."""
    return [backward_kernel(with_depth) for with_depth in (False, True)]


@cache
def backward_kernel(with_depth: bool) -> wp.Kernel:
    """Return the kernel that writes the gradient records of one tile."""
    fields = COLOR_FIELDS + with_depth
    planes, lane_count = 5 + with_depth, 8 + with_depth
    name = "backward_depth" if with_depth else "backward_color"

    @wp.kernel(name=name, module="unique", module_options=vector_module_options())
    def backward(
        first: int,
        splats: Splats,
        pairs: TilePairs,
        drawn: Planes,
        tile_ends: wp.array[int],
        adjoint: Planes,
        # outputs
        pair_gradients: wp.array2d[float],  # [pairs, `COLOR_FIELDS`, and one of depth]
    ):
        """Write the gradient records of one tile; re-reads what the forward pass wrote."""
        tile = first + wp.tid()
        views = splats.views
        records = splats.records
        members = pairs.members
        plane = drawn.plane
        columns = views[0].columns
        tile_column = tile % columns
        tile_row = tile // columns
        if tile_row >= views[0].rows:
            return
        tile_x = tile_column * TILE
        tile_y = tile_row * TILE
        start = drawn.origin + tile_y * drawn.pitch + tile_x
        begin = pairs.starts[tile]
        end = pairs.starts[tile + 1]
        if begin == end:
            return
        # Transmittance so far, then S of the module docstring, then v.
        memory = wp.zeros(shape=(wp.static(planes_memory(planes + 1)),), dtype=float)
        state = wp.array(
            ptr=cache_line_at(memory.ptr),
            shape=(wp.static((planes + 1) * PLANE_FLOATS),),
            dtype=float,
        )
        lanes = wp.static(planes * PLANE_FLOATS)
        for row in range(2 * TILE):  # of the left half, then of the right one
            q = row * BLOCK_COLUMNS
            p = start + (row % TILE) * drawn.pitch + (row // TILE) * BLOCK_COLUMNS
            # Views of the kernel's own, whose stride LLVM knows.
            red = floats_from(drawn.image, p, BLOCK_COLUMNS)
            green = floats_from(drawn.image, plane + p, BLOCK_COLUMNS)
            blue = floats_from(drawn.image, 2 * plane + p, BLOCK_COLUMNS)
            through = floats_from(drawn.transmittance, p, BLOCK_COLUMNS)
            adj_r = floats_from(adjoint.image, p, BLOCK_COLUMNS)
            adj_g = floats_from(adjoint.image, plane + p, BLOCK_COLUMNS)
            adj_b = floats_from(adjoint.image, 2 * plane + p, BLOCK_COLUMNS)
            adj_t = floats_from(adjoint.transmittance, p, BLOCK_COLUMNS)
            if wp.static(with_depth):
                depth = floats_from(drawn.depth, p, BLOCK_COLUMNS)
                adj_d = floats_from(adjoint.depth, p, BLOCK_COLUMNS)
            for x in range(BLOCK_COLUMNS):
                ahead = red[x] * adj_r[x] + green[x] * adj_g[x] + blue[x] * adj_b[x]
                ahead += through[x] * adj_t[x]
                if wp.static(with_depth):
                    adj_sum = wp.where(through[x] < 1.0, adj_d[x] / (1.0 - through[x]), 0.0)
                    # T e E / (1 - T) for the transmittance, and sum w z . v = e E for the sum.
                    ahead += depth[x] * adj_sum
                    state[_ADJ_DEPTH + q + x] = adj_sum
                state[q + x] = 1.0
                state[_AHEAD + q + x] = ahead
                state[_ADJ_R + q + x] = adj_r[x]
                state[_ADJ_G + q + x] = adj_g[x]
                state[_ADJ_B + q + x] = adj_b[x]
        stop = tile_ends[tile]
        all_pairs = pairs.starts[columns * views[0].rows]
        for k in range(begin, stop):
            prefetch_splat(records, members, k + GROUP, all_pairs)
            blocks = pairs.blocks[k]
            to = members[k][1]
            if blocks == 0:  # the corner of a box, or saturated
                for unused in range(wp.static(fields)):
                    pair_gradients[to, unused] = 0.0
                continue
            g = members[k][0]
            splat = tile_splat(records, g, tile_x, tile_y)
            z = float(0.0)
            if wp.static(with_depth):
                z = splats.depths[g]
            sum_0 = float(0.0)
            sum_x = float(0.0)
            sum_y = float(0.0)
            sum_xx = float(0.0)
            sum_xy = float(0.0)
            sum_yy = float(0.0)
            sum_r = float(0.0)
            sum_g = float(0.0)
            sum_b = float(0.0)
            sum_depth = float(0.0)
            for lane_z in range(wp.static(lane_count * _LANES)):
                state[lanes + lane_z] = 0.0
            while blocks != 0:
                at = lowest_bit(blocks)
                blocks = blocks & (blocks - 1)
                block = (at & BLOCKS_MASK) * BLOCK
                side = ((at >> BLOCK_ROW_SHIFT) & 1) * _RIGHT
                left = block_left(at, splat)
                top = block_top(at, splat)
                for i in range(BLOCK):
                    dx = float(i & COLUMN_MASK) + left
                    dy = float(i >> BLOCK_SHIFT) + top
                    power = power_at(splat, dx, dy)
                    raw = splat.opacity * exp_in_range(power)
                    alpha = capped_and_cut(raw)
                    before = state[block + i]
                    after = before - before * alpha
                    weight = wp.where(after >= _LEAST, alpha * before, 0.0)
                    state[block + i] = wp.where(after >= _LEAST, after, 0.0)
                    v_r = state[_ADJ_R + block + i]
                    v_g = state[_ADJ_G + block + i]
                    v_b = state[_ADJ_B + block + i]
                    shine = splat.red * v_r + splat.green * v_g + splat.blue * v_b
                    if wp.static(with_depth):
                        v_d = state[_ADJ_DEPTH + block + i]
                        shine = shine + z * v_d
                        state[lanes + _LANE_DEPTH + i] = (
                            state[lanes + _LANE_DEPTH + i] + weight * v_d
                        )
                    rest = state[_AHEAD + block + i] - weight * shine
                    state[_AHEAD + block + i] = rest
                    d_alpha = before * shine - rest / (1.0 - alpha)
                    # dL/dpower: zero where capped, cut, or stopped
                    slope = slope_in_power(raw, alpha)
                    d_power = wp.where(after >= _LEAST, d_alpha * slope, 0.0)
                    state[lanes + side + i] = state[lanes + side + i] + d_power
                    state[lanes + _LANE_Y + side + i] = (
                        state[lanes + _LANE_Y + side + i] + d_power * dy
                    )
                    state[lanes + _LANE_YY + i] = state[lanes + _LANE_YY + i] + d_power * dy * dy
                    state[lanes + _LANE_R + i] = state[lanes + _LANE_R + i] + weight * v_r
                    state[lanes + _LANE_G + i] = state[lanes + _LANE_G + i] + weight * v_g
                    state[lanes + _LANE_B + i] = state[lanes + _LANE_B + i] + weight * v_b
            for lane in range(BLOCK):
                offset = float(lane & COLUMN_MASK) - splat.mean_x
                offset_right = offset + float(BLOCK_COLUMNS)
                power_left = state[lanes + lane]
                power_right = state[lanes + _RIGHT + lane]
                power_y_left = state[lanes + _LANE_Y + lane]
                power_y_right = state[lanes + _LANE_Y + _RIGHT + lane]
                sum_0 += power_left + power_right
                sum_x += power_left * offset + power_right * offset_right
                sum_xx += power_left * offset * offset + power_right * offset_right * offset_right
                sum_y += power_y_left + power_y_right
                sum_xy += power_y_left * offset + power_y_right * offset_right
                sum_yy += state[lanes + _LANE_YY + lane]
                sum_r += state[lanes + _LANE_R + lane]
                sum_g += state[lanes + _LANE_G + lane]
                sum_b += state[lanes + _LANE_B + lane]
                if wp.static(with_depth):
                    sum_depth += state[lanes + _LANE_DEPTH + lane]
            pair_gradients[to, 0] = splat.a * sum_x + splat.b * sum_y
            pair_gradients[to, 1] = splat.b * sum_x + splat.c * sum_y
            pair_gradients[to, 2] = -0.5 * sum_xx
            pair_gradients[to, 3] = -sum_xy
            pair_gradients[to, 4] = -0.5 * sum_yy
            pair_gradients[to, 5] = sum_0 / splat.opacity
            pair_gradients[to, 6] = sum_r
            pair_gradients[to, 7] = sum_g
            pair_gradients[to, 8] = sum_b
            if wp.static(with_depth):
                pair_gradients[to, wp.static(COLOR_FIELDS)] = sum_depth
        for rest_k in range(stop, end):
            for field in range(wp.static(fields)):
                pair_gradients[members[rest_k][1], field] = 0.0

    return backward
