# type: ignore
# (device code, which Warp's stubs do not type)
"""Compositing on a GPU: a block of threads per 16x16 tile, one thread per pixel.

The formulas stand in `digs_warp.splat.rasterize`. The threads of a block load the records of a batch of
splats into shared memory together (3DGS), so that each record is read from global memory once per tile
rather than once per pixel, and the block leaves when all of its pixels are saturated.

The kernels need blocks of `BLOCK_THREADS` threads, and every thread has to reach every tile function: a pixel
that is outside of the image or saturated goes on without work. Warp runs such blocks on a CPU, too, one
thread after the other, where ``wp.config.enable_cpu_blocks`` is on: for tests, it is slow.
"""

from functools import cache
from typing import Any

import warp as wp

from digs_warp.splat.alpha_cut import STEP_CUT, AlphaCut
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
    Planes,
    Splats,
    TilePairs,
)
from digs_warp.splat.tile import TILE

wp.set_module_options({"enable_backward": False})

BLOCK_THREADS = TILE_PIXELS
# Splats whose records are loaded together: 64 take 2.3 KB of shared memory, so that it never limits how many
# blocks run at once.
BATCH = wp.constant(64)
# Columns of a record that compositing reads: the first ones.
READ_FIELDS = wp.constant(COLOR_FIELDS)


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
        self._launch = wp.launch_tiled(
            kernel,
            dim=[tiles],
            inputs=inputs,
            block_dim=BLOCK_THREADS,
            device=device,
            record_cmd=True,
        )

    def run(self) -> None:
        """Execute."""
        self._launch.launch()


@wp.func
def offset_from_center(records: Any, k: int, x: int, y: int) -> wp.vec2:
    """Offset [px] of the centre of pixel (x, y) from that of splat k of a batch."""
    return wp.vec2(
        float(x) + 0.5 - records[k, SPLAT_U],
        float(y) + 0.5 - records[k, SPLAT_V],
    )


@wp.func
def uncapped_alpha(records: Any, k: int, offset: wp.vec2) -> float:
    """Opacity times exp(-q / 2) of splat k of a batch at an offset [px] from its centre."""
    dx = offset[0]
    dy = offset[1]
    q = records[k, SPLAT_A] * dx * dx + records[k, SPLAT_C] * dy * dy
    power = wp.min(-0.5 * q - records[k, SPLAT_B] * dx * dy, 0.0)
    return records[k, SPLAT_OPACITY] * wp.exp(power)


@wp.func
def batch_color(records: Any, k: int) -> wp.vec3:
    """Colour of splat k of a batch."""
    return wp.vec3(records[k, SPLAT_RED], records[k, SPLAT_GREEN], records[k, SPLAT_BLUE])


@cache
def forward_cooperative_kernel(
    with_depth: bool, with_normals: bool, cut: AlphaCut = STEP_CUT
) -> wp.Kernel:
    """Return the kernel in which a block of threads composites one tile.

    To be run by `CooperativeLaunch`.
    """
    alpha_of = cut.alpha

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
        # Arrays of a struct by a name of their own: tile functions ask for their rank.
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
                drawn.depth[p + drawn.plane] = median
            if wp.static(with_normals):
                for axis in range(3):
                    drawn.normals[p + axis * drawn.plane] = normal[axis]

    return forward
