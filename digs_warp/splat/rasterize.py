"""Compositing on the CPU: one Warp thread per 16x16 tile, inner loops that LLVM turns into vector code.

Per pixel, front to back over the splats i of its tile (3DGS):

    alpha_i = min(MAX_ALPHA, o_i exp(-q_i / 2)),  not drawn below MIN_ALPHA
    w_i     = T alpha_i,   C += w_i c_i,   T <- T (1 - alpha_i),  stop before T falls under MIN_TRANSMITTANCE
    image   = C + T background

With depths z_i, the expected depth is (sum w_i z_i) / (sum w_i), and the median depth is the z_i at which T
passes 1/2.

The backward pass (`digs_warp.splat.rasterize_adjoint`) walks the same list in the same order. With
v = dL/dimage and S = sum of what splat i and those behind it (and the background) still add to v . image,

    S <- S - T alpha_i (c_i . v),   dL/dalpha_i = T (c_i . v) - S / (1 - alpha_i)

Depth enters as a further channel of c and v. For the expected depth E with gradient e, the channel
sum w_i z_i has v = e / (1 - T), and T receives e E / (1 - T).

No division by a vanishing transmittance, and no reversed list. Each (tile, splat) pair owns one record of
partial gradients: threads never share an address, so the result is the same for any number of them.

What keeps the inner loops fast: no libm calls, no branches (`wp.where`), no variable name used in two
loops, and all pixel state of a tile, copies of its gradient planes included, in one array whose stride LLVM
knows (a read from a Warp array, whose stride is known only at run time, becomes a gather).
`digs_warp.splat.tile` says how that state lies in memory, and why.
Splats are drawn in groups: which blocks of the tile each one touches is found for the group at once
(`digs_warp.splat.tile`), and kept for the backward pass.
What a view does not ask for is not in the kernel: there is one per set of outputs.
A test compiles both passes with LLVM's vectorization remarks on and fails when a loop falls out.
"""

from functools import cache

import warp as wp

from digs_warp.device.contiguous import cache_line_at
from digs_warp.device.kernel_options import vector_module_options
from digs_warp.splat.config import MIN_TRANSMITTANCE
from digs_warp.splat.records import (
    SPLAT_CHORD,
    SPLAT_HALF_WIDTH,
    SPLAT_PEAK,
    SPLAT_SLOPE,
    SPLAT_TAPER,
    SPLAT_U,
    SPLAT_V,
    Planes,
    Splats,
    TilePairs,
)
from digs_warp.splat.tile import (
    ALL_BLOCKS,
    BLOCK,
    BLOCK_COLUMNS,
    BLOCK_SHIFT,
    BLOCKS_MASK,
    COLUMN_MASK,
    GROUP,
    HALF_PIXELS,
    PIXELS,
    PLANE_FLOATS,
    TILE,
    Ellipse,
    block_left,
    block_top,
    capped_and_cut,
    exp_in_range,
    fill_tile,
    live_blocks,
    lowest_bit,
    planes_memory,
    power_at,
    prefetch_splat,
    tile_splat,
    touched_blocks,
    write_row,
)

wp.set_module_options({"enable_backward": False})

_LEAST = wp.constant(MIN_TRANSMITTANCE)

# The least share of a pixel that a splat leaves to those behind it, and so the least that is divided by.
SMALLEST = 2.0**-24

# Planes of a tile. A saturated pixel has working = 0 for good; final = 1 - sum of weights keeps its
# transmittance. (Selecting the old value instead would cost the vectorization of the loop.)
_FINAL = wp.constant(PLANE_FLOATS)
_RED = wp.constant(2 * PLANE_FLOATS)
_GREEN = wp.constant(3 * PLANE_FLOATS)
_BLUE = wp.constant(4 * PLANE_FLOATS)
_DEPTH = wp.constant(5 * PLANE_FLOATS)
_MEDIAN = wp.constant(6 * PLANE_FLOATS)
_PLANE = wp.constant(PLANE_FLOATS)


def usual_kernels() -> list[wp.Kernel]:
    """Return the kernels of a training with its measuring, for `digs-warp precompile`."""
    return [forward_kernel(depths) for depths in range(3)]


@cache
def forward_kernel(depths: int) -> wp.Kernel:
    """Return the kernel that composites one tile, with so many depths."""
    with_depth, with_median = depths > 0, depths > 1
    planes = 5 + depths

    @wp.kernel(name=f"forward_{depths}", module="unique", module_options=vector_module_options())
    def forward(
        first: int,
        splats: Splats,
        pairs: TilePairs,  # written: the blocks
        background: wp.array[float],  # [3]
        filled: wp.array[
            int
        ],  # [4] tile columns first .. end, rows first .. end: where empty ones matter
        # outputs
        drawn: Planes,
        tile_ends: wp.array[int],  # [tiles] one past the last pair that any pixel drew
    ):
        """Composite one tile."""
        tile = first + wp.tid()
        views = splats.views
        records = splats.records
        members = pairs.members
        plane = drawn.plane
        pitch = drawn.pitch
        columns = views[0].columns
        tile_column = tile % columns
        tile_row = tile // columns
        if tile_row >= views[0].rows:
            return
        width = views[0].width
        height = views[0].height
        tile_x = tile_column * TILE
        tile_y = tile_row * TILE
        begin = pairs.starts[tile]
        end = pairs.starts[tile + 1]
        start = drawn.origin + tile_y * pitch + tile_x
        inner_width = wp.min(TILE, width - tile_x)
        inner_height = wp.min(TILE, height - tile_y)
        if begin == end:
            tile_ends[tile] = end
            if tile_column < filled[0] or tile_column >= filled[1]:
                return
            if tile_row < filled[2] or tile_row >= filled[3]:
                return
            for channel in range(3):
                at = start + channel * plane
                fill_tile(at, inner_width, inner_height, pitch, background[channel], drawn.image)
            fill_tile(start, inner_width, inner_height, pitch, 1.0, drawn.transmittance)
            if wp.static(with_depth):
                for of_depth in range(wp.static(depths)):
                    at_depth = start + of_depth * plane
                    fill_tile(at_depth, inner_width, inner_height, pitch, 0.0, drawn.depth)
            return
        memory = wp.zeros(shape=(wp.static(planes_memory(planes + 1)),), dtype=float)
        state = wp.array(
            ptr=cache_line_at(memory.ptr),
            shape=(wp.static((planes + 1) * PLANE_FLOATS),),
            dtype=float,
        )
        for p in range(PIXELS):
            state[p] = 1.0
            state[_FINAL + p] = 1.0
        # A view of the kernel's own has a stride that LLVM knows.
        touched_memory = wp.zeros(shape=(wp.static(int(GROUP)),), dtype=int)
        touched = wp.array(ptr=touched_memory.ptr, shape=(wp.static(int(GROUP)),), dtype=int)
        fields = wp.static(planes * PLANE_FLOATS)
        all_pairs = pairs.starts[columns * views[0].rows]
        stop = end
        live = int(ALL_BLOCKS)
        for group in range((end - begin + GROUP - 1) // GROUP):
            group_first = begin + group * GROUP
            group_end = wp.min(group_first + GROUP, end)
            if group > 0:
                live = live_blocks(state)
                if live == 0:
                    stop = group_first
                    break
            # All records of a group are asked for at once: one that is not in the cache takes as long as
            # several blocks. And which blocks come next is known before the present ones are finished.
            for ahead in range(GROUP):
                g_ahead = members[wp.min(group_first + ahead, end - 1)][0]
                state[fields + ahead] = records[g_ahead, SPLAT_U]
                state[fields + GROUP + ahead] = records[g_ahead, SPLAT_V]
                state[fields + 2 * GROUP + ahead] = records[g_ahead, SPLAT_HALF_WIDTH]
                state[fields + 3 * GROUP + ahead] = records[g_ahead, SPLAT_SLOPE]
                state[fields + 4 * GROUP + ahead] = records[g_ahead, SPLAT_CHORD]
                state[fields + 5 * GROUP + ahead] = records[g_ahead, SPLAT_TAPER]
                state[fields + 6 * GROUP + ahead] = records[g_ahead, SPLAT_PEAK]
                if wp.static(with_depth):
                    state[fields + 7 * GROUP + ahead] = splats.depths[g_ahead]
            for member in range(GROUP):
                ellipse = Ellipse()
                ellipse.mean_x = state[fields + member] - float(tile_x) - 0.5
                ellipse.mean_y = state[fields + GROUP + member] - float(tile_y) - 0.5
                ellipse.half_width = state[fields + 2 * GROUP + member]
                ellipse.slope = state[fields + 3 * GROUP + member]
                ellipse.chord = state[fields + 4 * GROUP + member]
                ellipse.taper = state[fields + 5 * GROUP + member]
                ellipse.peak = state[fields + 6 * GROUP + member]
                touched[member] = touched_blocks(ellipse)
            for k in range(group_first, group_end):
                prefetch_splat(records, members, k + 2 * GROUP, all_pairs)
                blocks = touched[k - group_first] & live
                pairs.blocks[k] = blocks
                if blocks == 0:
                    continue
                g = members[k][0]
                splat = tile_splat(records, g, tile_x, tile_y)
                z = float(0.0)
                if wp.static(with_depth):
                    z = state[fields + 7 * GROUP + k - group_first]
                while blocks != 0:
                    at = lowest_bit(blocks)
                    blocks = blocks & (blocks - 1)
                    block = (at & BLOCKS_MASK) * BLOCK
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
                        if wp.static(with_depth):
                            state[_DEPTH + block + i] = state[_DEPTH + block + i] + weight * z
                        if wp.static(with_median):
                            passed = wp.where(state[_FINAL + block + i] > 0.5, z, 0.0)
                            passed = wp.where(
                                state[_FINAL + block + i] - weight <= 0.5, passed, 0.0
                            )
                            state[_MEDIAN + block + i] = state[_MEDIAN + block + i] + passed
                        state[_FINAL + block + i] = state[_FINAL + block + i] - weight
                        state[_RED + block + i] = state[_RED + block + i] + weight * splat.red
                        state[_GREEN + block + i] = state[_GREEN + block + i] + weight * splat.green
                        state[_BLUE + block + i] = state[_BLUE + block + i] + weight * splat.blue
        tile_ends[tile] = stop
        back_r = background[0]
        back_g = background[1]
        back_b = background[2]
        for f in range(PIXELS):
            state[_RED + f] = state[_RED + f] + state[_FINAL + f] * back_r
            state[_GREEN + f] = state[_GREEN + f] + state[_FINAL + f] * back_g
            state[_BLUE + f] = state[_BLUE + f] + state[_FINAL + f] * back_b
            if wp.static(with_depth):
                share = 1.0 - state[_FINAL + f]
                mean_depth = state[_DEPTH + f] / wp.max(share, wp.static(SMALLEST))
                state[_DEPTH + f] = wp.where(share > 0.0, mean_depth, 0.0)
        for yy in range(inner_height):
            for side in range(2):
                to = start + yy * pitch + side * BLOCK_COLUMNS
                taken = (yy & 15) * BLOCK_COLUMNS + (side & 1) * HALF_PIXELS
                count = wp.min(BLOCK_COLUMNS, inner_width - side * BLOCK_COLUMNS)
                for channel_out in range(3):
                    here = _RED + channel_out * _PLANE + taken
                    write_row(count, state, here, to + channel_out * plane, drawn.image)
                write_row(count, state, _FINAL + taken, to, drawn.transmittance)
                if wp.static(with_depth):
                    write_row(count, state, _DEPTH + taken, to, drawn.depth)
                if wp.static(with_median):
                    write_row(count, state, _MEDIAN + taken, to + plane, drawn.depth)

    return forward
