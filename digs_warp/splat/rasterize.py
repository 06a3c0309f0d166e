# type: ignore
# (device code, which Warp's stubs do not type)
"""Compositing on the CPU: one Warp thread per 16x16 tile, inner loops that LLVM turns into vector code.

Per pixel, front to back over the splats i of its tile (3DGS):

    alpha_i = min(max_alpha, o_i exp(-q_i / 2)),  not drawn below min_alpha
    w_i     = T alpha_i,   C += w_i c_i,   T <- T (1 - alpha_i),  stop before T falls under min_transmittance
    image   = C + T background

With depths z_i and normals n_i, the expected depth is (sum w_i z_i) / (sum w_i), the median depth is the z_i
at which T passes 1/2, and the normal is sum w_i n_i.

The backward pass (`digs_warp.splat.rasterize_adjoint`) walks the same list in the same order. With
v = dL/dimage and S = sum of what splat i and those behind it (and the background) still add to v . image,

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
A test compiles both passes with LLVM's vectorization remarks on and fails when a loop falls out.
"""

from functools import cache

import warp as wp

from digs_warp.kernel_options import vector_module_options
from digs_warp.splat.config import TILE_PIXELS, RasterOptions
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

# Offsets of the channels in a tile's local array of the forward pass.
_GREEN = wp.constant(TILE_PIXELS)
_BLUE = wp.constant(2 * TILE_PIXELS)
_DEPTH = wp.constant(3 * TILE_PIXELS)
_MEDIAN = wp.constant(4 * TILE_PIXELS)
_NORMAL_X = wp.constant(5 * TILE_PIXELS)
_NORMAL_Y = wp.constant(6 * TILE_PIXELS)
_NORMAL_Z = wp.constant(7 * TILE_PIXELS)


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
        tile_x = tile_column * TILE
        tile_y = tile_row * TILE
        # A saturated pixel has working = 0 for good; final = 1 - sum of weights keeps its transmittance.
        # (Selecting the old value instead would cost the vectorization of the loop.)
        working = wp.zeros(shape=(PIXELS,), dtype=float)
        final = wp.zeros(shape=(PIXELS,), dtype=float)
        color = wp.zeros(shape=(wp.static(channels * TILE_PIXELS),), dtype=float)
        for p in range(PIXELS):
            working[p] = 1.0
            final[p] = 1.0
        begin = tile_starts[tile]
        end = tile_starts[tile + 1]
        stop = end
        low = int(0)  # rows above low and below high are saturated
        high = int(15)
        for k in range(begin, end):
            if (k - begin) % CHECK_EVERY == CHECK_EVERY - 1:
                alive = float(0.0)
                for r in range(PIXELS):
                    alive += working[r]
                if alive == 0.0:
                    stop = k
                    break
                if alive < CROWDED:
                    low = int(TILE)
                    high = int(-1)
                    for r_row in range(TILE):
                        alive_row = float(0.0)
                        for r_x in range(TILE):
                            alive_row += working[r_row * TILE + r_x]
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
            x_first = int(wp.max(wp.ceil(mean_x - half_width), 0.0)) // LANES
            x_last = int(wp.min(wp.floor(mean_x + half_width), 15.0)) // LANES
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
        for yy in range(wp.min(TILE, height - tile_y)):
            start = origin + (tile_y + yy) * pitch + tile_x
            for xx in range(wp.min(TILE, width - tile_x)):
                q = yy * TILE + xx
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
