# type: ignore
# (device code, which Warp's stubs do not type)
"""Compositing in its simplest correct form: one thread per pixel, as the formulas read.

What `digs-warp bench raster` compares with, and what tests hold against the fast kernels:
`digs_warp.splat.rasterize` (where the formulas stand) on a CPU, `digs_warp.splat.rasterize_cooperative` on
CUDA. Gradients are summed with atomics: exact in value; on a CPU these kernels run on one thread.
"""

import warp as wp

from digs_warp.splat.config import TILE_SIZE
from digs_warp.splat.footprint import ViewParams
from digs_warp.splat.records import (
    SPLAT_A,
    SPLAT_B,
    SPLAT_BLUE,
    SPLAT_C,
    SPLAT_GREEN,
    SPLAT_OPACITY,
    SPLAT_RED,
    SPLAT_U,
    SPLAT_V,
)

wp.set_module_options({"enable_backward": False})

_TILE = wp.constant(TILE_SIZE)


@wp.func
def falloff(splats: wp.array2d[float], g: int, dx: float, dy: float) -> float:
    """exp(-q / 2) of splat g at an offset [px] from its centre."""
    q = splats[g, SPLAT_A] * dx * dx + splats[g, SPLAT_C] * dy * dy
    return wp.exp(wp.min(-0.5 * q - splats[g, SPLAT_B] * dx * dy, 0.0))


@wp.func
def color_of(splats: wp.array2d[float], g: int) -> wp.vec3:
    """Colour of splat g."""
    return wp.vec3(splats[g, SPLAT_RED], splats[g, SPLAT_GREEN], splats[g, SPLAT_BLUE])


@wp.func
def is_drawn(view: ViewParams, x: int, y: int) -> bool:
    """Whether a pixel lies in the image and in a tile that is drawn."""
    column = x // _TILE
    row = y // _TILE
    inside = x < view.width and y < view.height
    inside = inside and column >= view.first_column and column < view.end_column
    return inside and row >= view.first_row and row < view.end_row


@wp.func
def add_vector(records: wp.array2d[float], k: int, field: int, value: wp.vec3):
    """Add to three columns of a gradient record."""
    for i in range(3):
        wp.atomic_add(records, k, field + i, value[i])


@wp.kernel
def forward_reference_kernel(
    views: wp.array[ViewParams],
    pitch: int,
    plane: int,
    origin: int,
    splats: wp.array2d[float],
    depths: wp.array[float],
    normals: wp.array[wp.vec3],
    tile_starts: wp.array[int],
    tile_splats: wp.array[int],
    background: wp.array[float],
    # outputs
    image: wp.array[float],
    transmittance: wp.array[float],
    depth_planes: wp.array[float],  # empty: not wanted
    normal_planes: wp.array[float],  # empty: not wanted
    pixel_ends: wp.array[int],  # 1 padded plane: one past the last pair that the pixel drew
):
    """Composite one pixel."""
    y, x = wp.tid()
    view = views[0]
    if not is_drawn(view, x, y):
        return
    tile = (y // _TILE) * view.columns + x // _TILE
    t = float(1.0)
    color = wp.vec3(0.0, 0.0, 0.0)
    depth = float(0.0)
    median = float(0.0)
    normal = wp.vec3(0.0, 0.0, 0.0)
    stop = tile_starts[tile + 1]
    for k in range(tile_starts[tile], tile_starts[tile + 1]):
        g = tile_splats[k]
        dx = float(x) + 0.5 - splats[g, SPLAT_U]
        dy = float(y) + 0.5 - splats[g, SPLAT_V]
        alpha = wp.min(view.max_alpha, splats[g, SPLAT_OPACITY] * falloff(splats, g, dx, dy))
        if alpha >= view.min_alpha:
            after = t * (1.0 - alpha)
            if after < view.min_transmittance:
                stop = k
                break
            color += t * alpha * color_of(splats, g)
            depth += t * alpha * depths[g]
            if t > 0.5 and after <= 0.5:
                median = depths[g]
            if normal_planes.shape[0] > 0:
                normal += t * alpha * normals[g]
            t = after
    p = origin + y * pitch + x
    for channel in range(3):
        image[p + channel * plane] = color[channel] + t * background[channel]
    transmittance[p] = t
    pixel_ends[p] = stop
    if depth_planes.shape[0] > 0:
        depth_planes[p] = wp.where(t < 1.0, depth / (1.0 - t), 0.0)
        depth_planes[p + plane] = median
    if normal_planes.shape[0] > 0:
        for axis in range(3):
            normal_planes[p + axis * plane] = normal[axis]


@wp.kernel
def backward_reference_kernel(
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
    pixel_ends: wp.array[int],
    adj_image: wp.array[float],
    adj_transmittance: wp.array[float],
    adj_depth: wp.array[float],  # empty: there is no depth
    adj_normals: wp.array[float],  # empty: there are no normals
    depth_field: int,  # columns of the gradient record
    normal_field: int,
    absolute_field: int,
    tile_pairs: wp.array[int],  # [pairs] where the record of each goes
    # outputs
    pair_gradients: wp.array2d[float],  # [pairs, fields of the layout], zeroed by the caller
):
    """Add one pixel's share to the gradient records of its tile."""
    y, x = wp.tid()
    view = views[0]
    if not is_drawn(view, x, y):
        return
    tile = (y // _TILE) * view.columns + x // _TILE
    p = origin + y * pitch + x
    v = wp.vec3(adj_image[p], adj_image[p + plane], adj_image[p + 2 * plane])
    pixel = wp.vec3(image[p], image[p + plane], image[p + 2 * plane])
    ahead = wp.dot(pixel, v) + transmittance[p] * adj_transmittance[p]
    v_depth = float(0.0)
    v_normal = wp.vec3(0.0, 0.0, 0.0)
    if depth_field >= 0:
        if transmittance[p] < 1.0:
            v_depth = adj_depth[p] / (1.0 - transmittance[p])
        ahead += depth_planes[p] * v_depth
    if normal_field >= 0:
        for axis in range(3):
            v_normal[axis] = adj_normals[p + axis * plane]
            ahead += normal_planes[p + axis * plane] * v_normal[axis]
    t = float(1.0)
    for k in range(tile_starts[tile], pixel_ends[p]):
        g = tile_splats[k]
        to = tile_pairs[k]
        dx = float(x) + 0.5 - splats[g, SPLAT_U]
        dy = float(y) + 0.5 - splats[g, SPLAT_V]
        opacity = splats[g, SPLAT_OPACITY]
        raw = opacity * falloff(splats, g, dx, dy)
        alpha = wp.min(view.max_alpha, raw)
        if alpha >= view.min_alpha:
            shine = wp.dot(color_of(splats, g), v)
            if depth_field >= 0:
                shine += depths[g] * v_depth
                wp.atomic_add(pair_gradients, to, depth_field, t * alpha * v_depth)
            if normal_field >= 0:
                shine += wp.dot(normals[g], v_normal)
                add_vector(pair_gradients, to, normal_field, t * alpha * v_normal)
            ahead -= t * alpha * shine
            if raw <= view.max_alpha:
                d_power = (t * shine - ahead / (1.0 - alpha)) * alpha
                along_x = splats[g, SPLAT_A] * dx + splats[g, SPLAT_B] * dy
                along_y = splats[g, SPLAT_B] * dx + splats[g, SPLAT_C] * dy
                wp.atomic_add(pair_gradients, to, 0, d_power * along_x)
                wp.atomic_add(pair_gradients, to, 1, d_power * along_y)
                wp.atomic_add(pair_gradients, to, 2, -0.5 * d_power * dx * dx)
                wp.atomic_add(pair_gradients, to, 3, -d_power * dx * dy)
                wp.atomic_add(pair_gradients, to, 4, -0.5 * d_power * dy * dy)
                wp.atomic_add(pair_gradients, to, 5, d_power / opacity)
                if absolute_field >= 0:
                    wp.atomic_add(pair_gradients, to, absolute_field, wp.abs(d_power * along_x))
                    wp.atomic_add(pair_gradients, to, absolute_field + 1, wp.abs(d_power * along_y))
            add_vector(pair_gradients, to, 6, t * alpha * v)
            t *= 1.0 - alpha
