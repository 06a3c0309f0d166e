"""Compositing on a GPU: a block of threads per 16x16 tile, one thread per pixel.

The formulas are in `digs_warp.splat.rasterize`. The threads of a block load the records of a batch of
splats into shared memory together (3DGS), so that each record is read from global memory once per tile
rather than once per pixel, and the block leaves when all of its pixels are saturated.

Every thread has to reach every tile function: a pixel that is outside of the image or saturated goes on
without work. The kernels are run by `digs_warp.splat.cooperative`.
"""

from functools import cache
from typing import Any

import warp as wp

from digs_warp.splat.config import TILE_PIXELS
from digs_warp.splat.records import (
    COLOR_FIELDS,
    SPLAT_A,
    SPLAT_B,
    SPLAT_BLUE,
    SPLAT_C,
    SPLAT_GREEN,
    SPLAT_OPACITY,
    SPLAT_RED,
    SPLAT_U,
    SPLAT_V,
    GradientLayout,
    Planes,
    Splats,
    TilePairs,
)
from digs_warp.splat.tile import STEP_CUT, TILE, AlphaCut

wp.set_module_options({"enable_backward": False})

BLOCK_THREADS = TILE_PIXELS


def cooperative_module_options() -> dict[str, Any]:
    """Return the Warp module options of kernels that run in blocks of `BLOCK_THREADS` threads."""
    return {"enable_backward": False, "block_dim": BLOCK_THREADS}


class CooperativeLaunch:
    """A recorded launch of a kernel of this kind over ``tiles`` tiles.

    Raises:
        ValueError: the device is a CPU, and Warp is not told to run blocks of threads there.
    """

    def __init__(self, kernel: wp.Kernel, tiles: int, inputs: list[Any], device: str) -> None:
        if device == "cpu" and not wp.config.enable_cpu_blocks:
            raise ValueError("cooperative kernels need wp.config.enable_cpu_blocks = True on a CPU")
        self._inputs = inputs  # keeps the arrays alive: a recorded launch holds raw addresses
        launch = wp.launch_tiled(
            kernel,
            dim=[tiles],
            inputs=inputs,
            block_dim=BLOCK_THREADS,
            device=device,
            record_cmd=True,
        )
        assert launch is not None  # because of record_cmd
        self._launch = launch

    def run(self) -> None:
        """Execute."""
        self._launch.launch()


_THREADS = wp.constant(BLOCK_THREADS)
# Splats whose records are loaded together: 64 take 2.3 KB of shared memory, so that it never limits how many
# blocks run at once.
BATCH = wp.constant(64)
# Columns of a record that compositing reads: the first ones.
READ_FIELDS = wp.constant(COLOR_FIELDS)


@wp.func
def offset_from_center(records: Any, k: int, x: int, y: int) -> wp.vec2:
    """Offset [px] of the center of pixel (x, y) from that of splat k of a batch."""
    return wp.vec2(
        float(x) + 0.5 - records[k, SPLAT_U],
        float(y) + 0.5 - records[k, SPLAT_V],
    )


@wp.func
def uncapped_alpha(records: Any, k: int, offset: wp.vec2) -> float:
    """Opacity times exp(-q / 2) of splat k of a batch at an offset [px] from its center."""
    dx = offset[0]
    dy = offset[1]
    q = records[k, SPLAT_A] * dx * dx + records[k, SPLAT_C] * dy * dy
    power = wp.min(-0.5 * q - records[k, SPLAT_B] * dx * dy, 0.0)
    return records[k, SPLAT_OPACITY] * wp.exp(power)


@wp.func
def batch_color(records: Any, k: int) -> wp.vec3:
    """Color of splat k of a batch."""
    return wp.vec3(records[k, SPLAT_RED], records[k, SPLAT_GREEN], records[k, SPLAT_BLUE])


@cache
def forward_cooperative_kernel(
    depths: int, with_normals: bool, cut: AlphaCut = STEP_CUT
) -> wp.Kernel:
    """Return the kernel in which a block of threads composites one tile, with a number of depths.

    To be run by `CooperativeLaunch`.
    """
    alpha_of = cut.alpha
    with_depth, with_median = depths > 0, depths > 1

    @wp.kernel(
        name="forward_cooperative", module="unique", module_options=cooperative_module_options()
    )
    def forward(
        splats: Splats,
        pairs: TilePairs,
        background: wp.array[float],  # [3]
        # outputs
        drawn: Planes,
        pixel_ends: wp.array[int],  # 1 padded plane: one past the last pair that the pixel drew
    ):
        """Composite one pixel of a tile."""
        tile, lane = wp.tid()
        view = splats.views[0]
        # Copied to local names: tile functions need the rank of an array.
        all_members = pairs.splats
        all_records = splats.records
        all_depths = splats.depths
        all_normals = splats.normals
        tile_column = tile % view.columns
        tile_row = tile // view.columns
        if tile_row < view.first_row or tile_row >= view.end_row:
            return
        if tile_column < view.first_column or tile_column >= view.end_column:
            return
        x = tile_column * TILE + lane % TILE
        y = tile_row * TILE + lane // TILE
        inside = x < view.width and y < view.height
        begin = pairs.starts[tile]
        end = pairs.starts[tile + 1]
        t = float(1.0)
        color = wp.vec3(0.0, 0.0, 0.0)
        depth = float(0.0)
        median = float(0.0)
        normal = wp.vec3(0.0, 0.0, 0.0)
        stop = end
        live = wp.where(inside, int(1), int(0))
        for batch in range((end - begin + BATCH - 1) // BATCH):
            first = begin + batch * BATCH
            if wp.tile_sum(wp.tile(live))[0] == 0:
                break
            members = wp.tile_load(all_members, shape=BATCH, offset=first, storage="shared")
            records = wp.tile_load_indexed(
                all_records,
                indices=members,
                shape=(BATCH, READ_FIELDS),
                axis=0,
                storage="shared",
            )
            if wp.static(with_depth):
                batch_depths = wp.tile_load_indexed(
                    all_depths, indices=members, shape=(BATCH,), axis=0, storage="shared"
                )
            if wp.static(with_normals):
                batch_normals = wp.tile_load_indexed(
                    all_normals, indices=members, shape=(BATCH,), axis=0, storage="shared"
                )
            for k in range(wp.min(BATCH, end - first)):
                if live != 0:
                    raw = uncapped_alpha(records, k, offset_from_center(records, k, x, y))
                    alpha = alpha_of(raw, view.min_alpha, view.max_alpha)
                    after = t * (1.0 - alpha)
                    if after < view.min_transmittance:
                        live = int(0)
                        stop = first + k
                    elif alpha > 0.0:
                        weight = t * alpha
                        color += weight * batch_color(records, k)
                        if wp.static(with_depth):
                            depth += weight * batch_depths[k]
                        if wp.static(with_median):
                            if t > 0.5 and after <= 0.5:
                                median = batch_depths[k]
                        if wp.static(with_normals):
                            normal += weight * batch_normals[k]
                        t = after
        if inside:
            p = drawn.origin + y * drawn.pitch + x
            for channel in range(3):
                drawn.image[p + channel * drawn.plane] = color[channel] + t * background[channel]
            drawn.transmittance[p] = t
            pixel_ends[p] = stop
            if wp.static(with_depth):
                drawn.depth[p] = wp.where(t < 1.0, depth / (1.0 - t), 0.0)
            if wp.static(with_median):
                drawn.depth[p + drawn.plane] = median
            if wp.static(with_normals):
                for axis in range(3):
                    drawn.normals[p + axis * drawn.plane] = normal[axis]

    return forward


@cache
def backward_cooperative_kernel(
    with_depth: bool, with_normals: bool, with_absolute: bool, cut: AlphaCut = STEP_CUT
) -> wp.Kernel:
    """Return the kernel in which a block of threads writes the gradient records of one tile.

    ``with_absolute`` adds the sums of the absolute values of the gradient in u and v (AbsGS). To be run by
    `CooperativeLaunch`.
    """
    alpha_of, slope_of = cut.alpha, cut.slope
    layout = GradientLayout.of(with_depth, with_normals, with_absolute)
    Record = wp.types.vector(length=layout.fields, dtype=float)

    @wp.kernel(
        name="backward_cooperative", module="unique", module_options=cooperative_module_options()
    )
    def backward(
        splats: Splats,
        pairs: TilePairs,
        drawn: Planes,
        pixel_ends: wp.array[int],
        adjoint: Planes,
        # outputs
        pair_gradients: wp.array2d[float],  # [pairs, fields of the layout]
    ):
        """Add the share of one pixel of a tile to the records of its pairs."""
        tile, lane = wp.tid()
        view = splats.views[0]
        # Copied to local names: tile functions need the rank of an array.
        all_members = pairs.splats
        all_records = splats.records
        all_depths = splats.depths
        all_normals = splats.normals
        if tile // view.columns >= view.rows:
            return
        begin = pairs.starts[tile]
        end = pairs.starts[tile + 1]
        if begin == end:
            return
        x = (tile % view.columns) * TILE + lane % TILE
        y = (tile // view.columns) * TILE + lane // TILE
        pixel_end = begin
        v = wp.vec3(0.0, 0.0, 0.0)
        v_depth = float(0.0)
        v_normal = wp.vec3(0.0, 0.0, 0.0)
        ahead = float(0.0)
        if x < view.width and y < view.height:
            p = drawn.origin + y * drawn.pitch + x
            pixel_end = pixel_ends[p]
            v = wp.vec3(
                adjoint.image[p], adjoint.image[p + drawn.plane], adjoint.image[p + 2 * drawn.plane]
            )
            pixel = wp.vec3(
                drawn.image[p], drawn.image[p + drawn.plane], drawn.image[p + 2 * drawn.plane]
            )
            through = drawn.transmittance[p]
            ahead = wp.dot(pixel, v) + through * adjoint.transmittance[p]
            if wp.static(with_depth):
                if through < 1.0:
                    v_depth = adjoint.depth[p] / (1.0 - through)
                ahead += drawn.depth[p] * v_depth
            if wp.static(with_normals):
                for axis in range(3):
                    v_normal[axis] = adjoint.normals[p + axis * drawn.plane]
                    ahead += drawn.normals[p + axis * drawn.plane] * v_normal[axis]
        stop = wp.tile_max(wp.tile(pixel_end))[0]
        t = float(1.0)
        for batch in range((stop - begin + BATCH - 1) // BATCH):
            first = begin + batch * BATCH
            members = wp.tile_load(all_members, shape=BATCH, offset=first, storage="shared")
            records = wp.tile_load_indexed(
                all_records,
                indices=members,
                shape=(BATCH, READ_FIELDS),
                axis=0,
                storage="shared",
            )
            if wp.static(with_depth):
                batch_depths = wp.tile_load_indexed(
                    all_depths, indices=members, shape=(BATCH,), axis=0, storage="shared"
                )
            if wp.static(with_normals):
                batch_normals = wp.tile_load_indexed(
                    all_normals, indices=members, shape=(BATCH,), axis=0, storage="shared"
                )
            for k in range(wp.min(BATCH, stop - first)):
                share = Record()
                if first + k < pixel_end:
                    offset = offset_from_center(records, k, x, y)
                    raw = uncapped_alpha(records, k, offset)
                    alpha = alpha_of(raw, view.min_alpha, view.max_alpha)
                    if alpha > 0.0:
                        weight = t * alpha
                        shine = wp.dot(batch_color(records, k), v)
                        if wp.static(with_depth):
                            shine += batch_depths[k] * v_depth
                            share[wp.static(layout.depth)] = weight * v_depth
                        if wp.static(with_normals):
                            shine += wp.dot(batch_normals[k], v_normal)
                            share[wp.static(layout.normal)] = weight * v_normal[0]
                            share[wp.static(layout.normal + 1)] = weight * v_normal[1]
                            share[wp.static(layout.normal + 2)] = weight * v_normal[2]
                        ahead -= weight * shine
                        d_alpha = t * shine - ahead / (1.0 - alpha)
                        slope = slope_of(raw, alpha, view.min_alpha, view.max_alpha)
                        d_power = d_alpha * slope
                        dx = offset[0]
                        dy = offset[1]
                        d_u = d_power * (records[k, SPLAT_A] * dx + records[k, SPLAT_B] * dy)
                        d_v = d_power * (records[k, SPLAT_B] * dx + records[k, SPLAT_C] * dy)
                        share[0] = d_u
                        share[1] = d_v
                        share[2] = -0.5 * d_power * dx * dx
                        share[3] = -d_power * dx * dy
                        share[4] = -0.5 * d_power * dy * dy
                        share[5] = d_power / records[k, SPLAT_OPACITY]
                        share[6] = weight * v[0]
                        share[7] = weight * v[1]
                        share[8] = weight * v[2]
                        if wp.static(with_absolute):
                            share[wp.static(layout.absolute)] = wp.abs(d_u)
                            share[wp.static(layout.absolute + 1)] = wp.abs(d_v)
                        t = t * (1.0 - alpha)
                total = wp.tile_sum(wp.tile(share, preserve_type=True))[0]
                if lane == 0:
                    to = pairs.records[first + k]
                    for field in range(wp.static(layout.fields)):
                        pair_gradients[to, field] = total[field]
        for rest in range(stop + lane, end, _THREADS):
            for unused in range(wp.static(layout.fields)):
                pair_gradients[pairs.records[rest], unused] = 0.0

    return backward
