# type: ignore
# (device code, which Warp's stubs do not type)
"""Compositing in its simplest correct form: one thread per pixel, as the formulas read.

The path for CUDA, and the twin that the vectorized CPU kernels of `digs_warp.splat.rasterize` (where the
formulas stand) are tested against. Gradients are summed with atomics: exact in value, but on a GPU the
order, and so the last bits, vary from run to run; on a CPU these kernels run on one thread.
"""

import warp as wp

from digs_warp.splat.config import MAX_ALPHA, MIN_ALPHA, MIN_TRANSMITTANCE, TILE_SIZE
from digs_warp.splat.project import (
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
_MIN_ALPHA = wp.constant(MIN_ALPHA)
_MAX_ALPHA = wp.constant(MAX_ALPHA)
_STOP = wp.constant(MIN_TRANSMITTANCE)


@wp.func
def falloff(splats: wp.array2d[float], g: int, dx: float, dy: float) -> float:
    """exp(-q / 2) of splat g at an offset [px] from its centre."""
    q = splats[g, SPLAT_A] * dx * dx + splats[g, SPLAT_C] * dy * dy
    return wp.exp(wp.min(-0.5 * q - splats[g, SPLAT_B] * dx * dy, 0.0))


@wp.kernel
def forward_reference_kernel(
    columns: int,
    pitch: int,
    plane: int,
    origin: int,
    splats: wp.array2d[float],
    tile_starts: wp.array[int],
    tile_splats: wp.array[int],
    background: wp.array[float],
    # outputs
    image: wp.array[float],
    transmittance: wp.array[float],
    pixel_ends: wp.array[int],  # 1 padded plane: one past the last pair that the pixel drew
):
    """Composite one pixel."""
    y, x = wp.tid()
    tile = (y // _TILE) * columns + x // _TILE
    t = float(1.0)
    color = wp.vec3(0.0, 0.0, 0.0)
    stop = tile_starts[tile + 1]
    for k in range(tile_starts[tile], tile_starts[tile + 1]):
        g = tile_splats[k]
        dx = float(x) + 0.5 - splats[g, SPLAT_U]
        dy = float(y) + 0.5 - splats[g, SPLAT_V]
        alpha = wp.min(_MAX_ALPHA, splats[g, SPLAT_OPACITY] * falloff(splats, g, dx, dy))
        if alpha >= _MIN_ALPHA:
            after = t * (1.0 - alpha)
            if after < _STOP:
                stop = k
                break
            color += (
                t
                * alpha
                * wp.vec3(splats[g, SPLAT_RED], splats[g, SPLAT_GREEN], splats[g, SPLAT_BLUE])
            )
            t = after
    p = origin + y * pitch + x
    for channel in range(3):
        image[p + channel * plane] = color[channel] + t * background[channel]
    transmittance[p] = t
    pixel_ends[p] = stop


@wp.kernel
def backward_reference_kernel(
    columns: int,
    pitch: int,
    plane: int,
    origin: int,
    splats: wp.array2d[float],
    tile_starts: wp.array[int],
    tile_splats: wp.array[int],
    image: wp.array[float],
    transmittance: wp.array[float],
    pixel_ends: wp.array[int],
    adj_image: wp.array[float],
    adj_transmittance: wp.array[float],
    # outputs
    pair_gradients: wp.array2d[float],  # [pairs, GRADIENT_FIELDS], zeroed by the caller
):
    """Add one pixel's share to the gradient records of its tile."""
    y, x = wp.tid()
    tile = (y // _TILE) * columns + x // _TILE
    p = origin + y * pitch + x
    v = wp.vec3(adj_image[p], adj_image[p + plane], adj_image[p + 2 * plane])
    pixel = wp.vec3(image[p], image[p + plane], image[p + 2 * plane])
    ahead = wp.dot(pixel, v) + transmittance[p] * adj_transmittance[p]
    t = float(1.0)
    for k in range(tile_starts[tile], pixel_ends[p]):
        g = tile_splats[k]
        dx = float(x) + 0.5 - splats[g, SPLAT_U]
        dy = float(y) + 0.5 - splats[g, SPLAT_V]
        opacity = splats[g, SPLAT_OPACITY]
        raw = opacity * falloff(splats, g, dx, dy)
        alpha = wp.min(_MAX_ALPHA, raw)
        if alpha >= _MIN_ALPHA:
            color = wp.vec3(splats[g, SPLAT_RED], splats[g, SPLAT_GREEN], splats[g, SPLAT_BLUE])
            shine = wp.dot(color, v)
            ahead -= t * alpha * shine
            if raw <= _MAX_ALPHA:
                d_power = (t * shine - ahead / (1.0 - alpha)) * alpha
                along_x = splats[g, SPLAT_A] * dx + splats[g, SPLAT_B] * dy
                along_y = splats[g, SPLAT_B] * dx + splats[g, SPLAT_C] * dy
                wp.atomic_add(pair_gradients, k, 0, d_power * along_x)
                wp.atomic_add(pair_gradients, k, 1, d_power * along_y)
                wp.atomic_add(pair_gradients, k, 2, -0.5 * d_power * dx * dx)
                wp.atomic_add(pair_gradients, k, 3, -d_power * dx * dy)
                wp.atomic_add(pair_gradients, k, 4, -0.5 * d_power * dy * dy)
                wp.atomic_add(pair_gradients, k, 5, d_power / opacity)
            for channel in range(3):
                wp.atomic_add(pair_gradients, k, 6 + channel, t * alpha * v[channel])
            t *= 1.0 - alpha
