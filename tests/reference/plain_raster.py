"""Compositing in its simplest correct form: one thread per pixel, as the formulas read.

Tests compare the backends of the package with this one. The formulas are in `digs_warp.splat.rasterize`.
Gradients are summed with atomics, which are plain additions on a CPU: one thread.
"""

from dataclasses import dataclass

import warp as wp

from digs_warp.splat.backend import (
    CooperativeBackend,
    RasterBackend,
    RasterJob,
    RasterLaunches,
    VectorizedBackend,
    project_backward_each,
    project_each,
)
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
    PairGradients,
    Planes,
    Splats,
    TilePairs,
)

wp.set_module_options({"enable_backward": False})

_TILE = wp.constant(TILE_SIZE)


@wp.func
def falloff(splats: wp.array2d[float], g: int, dx: float, dy: float) -> float:
    """exp(-q / 2) of splat g at an offset [px] from its center."""
    q = splats[g, SPLAT_A] * dx * dx + splats[g, SPLAT_C] * dy * dy
    return wp.exp(wp.min(-0.5 * q - splats[g, SPLAT_B] * dx * dy, 0.0))


@wp.func
def color_of(splats: wp.array2d[float], g: int) -> wp.vec3:
    """Color of splat g."""
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
    splats: Splats,
    pairs: TilePairs,
    background: wp.array[float],
    # outputs
    drawn: Planes,  # empty: not wanted
    pixel_ends: wp.array[int],  # 1 padded plane: one past the last pair that the pixel drew
):
    """Composite one pixel."""
    y, x = wp.tid()
    view = splats.views[0]
    if not is_drawn(view, x, y):
        return
    tile = (y // _TILE) * view.columns + x // _TILE
    t = float(1.0)
    color = wp.vec3(0.0, 0.0, 0.0)
    depth = float(0.0)
    median = float(0.0)
    normal = wp.vec3(0.0, 0.0, 0.0)
    stop = pairs.starts[tile + 1]
    for k in range(pairs.starts[tile], pairs.starts[tile + 1]):
        g = pairs.splats[k]
        dx = float(x) + 0.5 - splats.records[g, SPLAT_U]
        dy = float(y) + 0.5 - splats.records[g, SPLAT_V]
        alpha = wp.min(
            view.max_alpha, splats.records[g, SPLAT_OPACITY] * falloff(splats.records, g, dx, dy)
        )
        if alpha >= view.min_alpha:
            after = t * (1.0 - alpha)
            if after < view.min_transmittance:
                stop = k
                break
            color += t * alpha * color_of(splats.records, g)
            depth += t * alpha * splats.depths[g]
            if t > 0.5 and after <= 0.5:
                median = splats.depths[g]
            if drawn.normals.shape[0] > 0:
                normal += t * alpha * splats.normals[g]
            t = after
    p = drawn.origin + y * drawn.pitch + x
    for channel in range(3):
        drawn.image[p + channel * drawn.plane] = color[channel] + t * background[channel]
    drawn.transmittance[p] = t
    pixel_ends[p] = stop
    if drawn.depth.shape[0] > 0:
        drawn.depth[p] = wp.where(t < 1.0, depth / (1.0 - t), 0.0)
        drawn.depth[p + drawn.plane] = median
    if drawn.normals.shape[0] > 0:
        for axis in range(3):
            drawn.normals[p + axis * drawn.plane] = normal[axis]


@wp.kernel
def backward_reference_kernel(
    splats: Splats,
    pairs: TilePairs,
    drawn: Planes,
    pixel_ends: wp.array[int],
    adjoint: Planes,
    # outputs
    gradients: PairGradients,  # zeroed by the caller
):
    """Add one pixel's share to the gradient records of its tile."""
    y, x = wp.tid()
    view = splats.views[0]
    if not is_drawn(view, x, y):
        return
    tile = (y // _TILE) * view.columns + x // _TILE
    p = drawn.origin + y * drawn.pitch + x
    v = wp.vec3(
        adjoint.image[p], adjoint.image[p + drawn.plane], adjoint.image[p + 2 * drawn.plane]
    )
    pixel = wp.vec3(drawn.image[p], drawn.image[p + drawn.plane], drawn.image[p + 2 * drawn.plane])
    ahead = wp.dot(pixel, v) + drawn.transmittance[p] * adjoint.transmittance[p]
    v_depth = float(0.0)
    v_normal = wp.vec3(0.0, 0.0, 0.0)
    if gradients.depth >= 0:
        if drawn.transmittance[p] < 1.0:
            v_depth = adjoint.depth[p] / (1.0 - drawn.transmittance[p])
        ahead += drawn.depth[p] * v_depth
    if gradients.normal >= 0:
        for axis in range(3):
            v_normal[axis] = adjoint.normals[p + axis * drawn.plane]
            ahead += drawn.normals[p + axis * drawn.plane] * v_normal[axis]
    t = float(1.0)
    for k in range(pairs.starts[tile], pixel_ends[p]):
        g = pairs.splats[k]
        to = pairs.records[k]
        dx = float(x) + 0.5 - splats.records[g, SPLAT_U]
        dy = float(y) + 0.5 - splats.records[g, SPLAT_V]
        opacity = splats.records[g, SPLAT_OPACITY]
        raw = opacity * falloff(splats.records, g, dx, dy)
        alpha = wp.min(view.max_alpha, raw)
        if alpha >= view.min_alpha:
            shine = wp.dot(color_of(splats.records, g), v)
            if gradients.depth >= 0:
                shine += splats.depths[g] * v_depth
                wp.atomic_add(gradients.records, to, gradients.depth, t * alpha * v_depth)
            if gradients.normal >= 0:
                shine += wp.dot(splats.normals[g], v_normal)
                add_vector(gradients.records, to, gradients.normal, t * alpha * v_normal)
            ahead -= t * alpha * shine
            if raw <= view.max_alpha:
                d_power = (t * shine - ahead / (1.0 - alpha)) * alpha
                along_x = splats.records[g, SPLAT_A] * dx + splats.records[g, SPLAT_B] * dy
                along_y = splats.records[g, SPLAT_B] * dx + splats.records[g, SPLAT_C] * dy
                wp.atomic_add(gradients.records, to, 0, d_power * along_x)
                wp.atomic_add(gradients.records, to, 1, d_power * along_y)
                wp.atomic_add(gradients.records, to, 2, -0.5 * d_power * dx * dx)
                wp.atomic_add(gradients.records, to, 3, -d_power * dx * dy)
                wp.atomic_add(gradients.records, to, 4, -0.5 * d_power * dy * dy)
                wp.atomic_add(gradients.records, to, 5, d_power / opacity)
                if gradients.absolute >= 0:
                    wp.atomic_add(
                        gradients.records, to, gradients.absolute, wp.abs(d_power * along_x)
                    )
                    wp.atomic_add(
                        gradients.records, to, gradients.absolute + 1, wp.abs(d_power * along_y)
                    )
            add_vector(gradients.records, to, 6, t * alpha * v)
            t *= 1.0 - alpha


@dataclass(frozen=True, eq=False)
class PlainLaunch:
    """A kernel over the pixels of the largest view."""

    kernel: wp.Kernel
    job: RasterJob
    inputs: list

    def run(self) -> None:
        if self.kernel is backward_reference_kernel:
            self.job.pair_gradients.records.zero_()
        pitch = self.job.drawn.pitch
        size = (
            self.job.drawn.plane // pitch,
            pitch,
        )  # with the padding, which the kernels leave alone
        wp.launch(self.kernel, dim=size, inputs=self.inputs, device=self.job.device)


@dataclass(frozen=True)
class PlainBackend:
    counting = False
    skips_empty_tiles = False

    def threads(self, wanted: int) -> int:
        return 1

    def ends(self, tiles: int, pixels: int) -> int:
        return pixels

    def record(self, job: RasterJob) -> RasterLaunches:
        raster = [job.splats, job.pairs, job.background, job.drawn, job.ends]
        adjoint = [job.splats, job.pairs, job.drawn, job.ends, job.adjoint, job.pair_gradients]
        return RasterLaunches(
            project_each(job),
            PlainLaunch(forward_reference_kernel, job, raster),
            PlainLaunch(backward_reference_kernel, job, adjoint),
            project_backward_each(job),
        )


BACKENDS: tuple[RasterBackend, ...] = (VectorizedBackend(), CooperativeBackend())
ALL_BACKENDS = (*BACKENDS, PlainBackend())


def backend_name(backend: RasterBackend) -> str:
    """For the names of tests."""
    return type(backend).__name__.removesuffix("Backend").lower()
