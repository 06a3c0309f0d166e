# type: ignore
# (device code, which Warp's stubs do not type)
"""Gradient of the compositing of `digs_warp.splat.cooperative`.

The formulas stand in `digs_warp.splat.rasterize`. The threads of a block sum a splat's gradient over their
pixels in a fixed order, and one of them writes the record of the (tile, splat) pair: no atomic additions, the
same bits each time.
"""

from functools import cache

import warp as wp

from digs_warp.splat.alpha_cut import STEP_CUT, AlphaCut
from digs_warp.splat.cooperative import (
    BATCH,
    BLOCK_THREADS,
    READ_FIELDS,
    batch_color,
    cooperative_module_options,
    offset_from_center,
    uncapped_alpha,
)
from digs_warp.splat.records import (
    SPLAT_A,
    SPLAT_B,
    SPLAT_C,
    SPLAT_OPACITY,
    GradientLayout,
    Planes,
    Splats,
    TilePairs,
)
from digs_warp.splat.tile import TILE

wp.set_module_options({"enable_backward": False})

_THREADS = wp.constant(BLOCK_THREADS)


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
        # Arrays of a struct by a name of their own: tile functions ask for their rank.
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
