"""Compositing on a GPU: a block of threads per 16x16 tile, two pixels per thread.

The formulas are in `digs_warp.splat.rasterize`. The threads of a block load the records of a batch of
splats into shared memory together (3DGS), so that each record is read from global memory once per tile
rather than once per pixel, and the block leaves when all of its pixels are saturated.

A warp draws a square of 8x8 pixels of the tile, two pixels a thread. Its lanes first look at a splat of the
batch each, and vote on which ones reach the square: the others cost nothing more.
In the backward pass the shares of the pixels in a splat's gradient are added up in each thread, then over
the warp if any of it has a share, then over the warps of the block once for a whole batch: always in the
same order, and without atomics.

Every thread has to reach every function of its warp and its block (`digs_warp.splat.lanes`): a pixel that is
outside of the image or saturated goes on without work. The kernels are run by `CooperativeLaunch`.
"""

from functools import cache
from typing import Any

import warp as wp

from digs_warp.splat.config import MIN_TRANSMITTANCE, TILE_PIXELS
from digs_warp.splat.lanes import (
    any_in_block,
    first_lane,
    float_at,
    lanes,
    meet_in_block,
    put_float,
    put_quad,
    put_sums,
    quad_at,
    shared_quads,
    vote,
    without_first,
)
from digs_warp.splat.records import (
    COLOR_FIELDS,
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
    PairGradients,
    Planes,
    Splats,
    TilePairs,
)
from digs_warp.splat.tile import TILE, capped_and_cut, slope_in_power

wp.set_module_options({"enable_backward": False})

# Pixels of a thread, one below the other: they share the reading of a record and the sums over a warp. With
# four an H200 takes a third longer, with one no less.
PIXELS = 2
BLOCK_THREADS = TILE_PIXELS // PIXELS
WARP = 32
# Splats whose records are loaded together.
BATCH = 64
# A splat in shared memory takes so many times four floats: its place (`reaches`), its form, its color and
# depth.
QUADS = 3
# Of a gradient record with depth.
MOST_FIELDS = COLOR_FIELDS + 1


def cooperative_module_options() -> dict[str, Any]:
    """Return the Warp module options of kernels that run in blocks of so many threads.

    Fast exponentials and divisions change an image by 1e-7, and save a third of the backward pass.
    """
    return {"enable_backward": False, "block_dim": BLOCK_THREADS, "fast_math": True}


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


_LEAST = wp.constant(MIN_TRANSMITTANCE)
_PIXELS = wp.constant(PIXELS)
_THREADS = wp.constant(BLOCK_THREADS)
_BATCH = wp.constant(BATCH)
_QUADS = wp.constant(QUADS)
_WARP_FLOATS = wp.constant(BATCH * MOST_FIELDS)

# A value of each pixel of a thread.
Floats = wp.types.vector(length=PIXELS, dtype=float)
Ints = wp.types.vector(length=PIXELS, dtype=int)


@wp.func
def first_pixel(tile_x: int, tile_y: int, thread: int) -> wp.vec2i:
    """The upper pixel of a thread, in the tile that begins there; the next one is `ROWS_APART` below."""
    warp = thread // 32
    lane = thread % 32
    return wp.vec2i(tile_x + 8 * (warp % 2) + lane % 8, tile_y + 8 * (warp // 2) + lane // 8)


_ROWS_APART = wp.constant(8 // PIXELS)


@wp.func
def reaches(place: wp.vec4, pixel: wp.vec2i, thread: int) -> int:
    """Whether the box of a splat, its center and half its size, has a pixel center of a warp's square."""
    left = float(pixel[0] - thread % 8) + 0.5
    top = float(pixel[1] - (thread % 32) // 8) + 0.5
    in_x = wp.abs(wp.clamp(place[0], left, left + 7.0) - place[0]) <= place[2]
    in_y = wp.abs(wp.clamp(place[1], top, top + 7.0) - place[1]) <= place[3]
    return wp.where(in_x and in_y, int(1), int(0))


_FORM = wp.constant(1)
_COLOR = wp.constant(2)


@wp.func_native(shared_quads(BATCH * QUADS, BATCH * QUADS))
def shared_records() -> wp.uint64:
    """Memory for the splats of a batch."""
    ...


# Each warp has sums of its own; on a CPU each thread.
_WARP_QUADS = BATCH * MOST_FIELDS // 4


@wp.func_native(shared_quads(BLOCK_THREADS // WARP * _WARP_QUADS, BLOCK_THREADS * _WARP_QUADS))
def shared_sums() -> wp.uint64:
    """Memory for the gradient records of a batch."""
    ...


@wp.func
def load_batch(thread: int, first: int, size: int, splats: Splats, pairs: TilePairs, to: wp.uint64):
    """Load a batch with all threads of a block."""
    for k in range(thread, size, _THREADS):
        g = pairs.members[first + k][0]
        at = k * _QUADS
        u = splats.records[g, SPLAT_U]
        v = splats.records[g, SPLAT_V]
        half_width = splats.records[g, SPLAT_HALF_WIDTH]
        put_quad(to, at, u, v, half_width, splats.records[g, SPLAT_HALF_HEIGHT])
        a = splats.records[g, SPLAT_A]
        b = splats.records[g, SPLAT_B]
        c = splats.records[g, SPLAT_C]
        put_quad(to, at + _FORM, a, b, c, splats.records[g, SPLAT_OPACITY])
        red = splats.records[g, SPLAT_RED]
        green = splats.records[g, SPLAT_GREEN]
        blue = splats.records[g, SPLAT_BLUE]
        put_quad(to, at + _COLOR, red, green, blue, splats.depths[g])


@wp.func
def uncapped_alpha(form: wp.vec4, dx: float, dy: float) -> float:
    """Opacity times exp(-q / 2) of a splat at an offset [px] from its center."""
    q = form[0] * dx * dx + form[2] * dy * dy
    power = wp.min(-0.5 * q - form[1] * dx * dy, 0.0)
    return form[3] * wp.exp(power)


@wp.func
def splats_reaching(records: wp.uint64, k: int, size: int, pixel: wp.vec2i, thread: int) -> int:
    """A bit for each lane of a warp: whether splat ``k``, which it looks at, reaches the square."""
    near = int(0)
    if k < size:
        near = reaches(quad_at(records, k * _QUADS), pixel, thread)
    return vote(near)


@cache
def forward_cooperative_kernel(depths: int) -> wp.Kernel:
    """Return the kernel in which a block of threads composites one tile, with a number of depths.

    To be run by `CooperativeLaunch`.
    """
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
        """Composite some pixels of a tile."""
        tile, thread = wp.tid()
        view = splats.views[0]
        tile_column = tile % view.columns
        tile_row = tile // view.columns
        if tile_row >= view.rows:
            return
        begin = pairs.starts[tile]
        end = pairs.starts[tile + 1]
        pixel = first_pixel(tile_column * TILE, tile_row * TILE, thread)
        records = shared_records()
        lane = thread % lanes()
        t = Floats()
        red = Floats()
        green = Floats()
        blue = Floats()
        depth = Floats()
        median = Floats()
        stop = Ints()
        live = Ints()
        ys = Ints()
        for i in range(_PIXELS):
            ys[i] = pixel[1] + i * _ROWS_APART
            t[i] = 1.0
            stop[i] = end
            live[i] = wp.where(pixel[0] < view.width and ys[i] < view.height, int(1), int(0))
        for batch in range((end - begin + _BATCH - 1) // _BATCH):
            first = begin + batch * _BATCH
            size = wp.min(_BATCH, end - first)
            alive = int(0)
            for i in range(_PIXELS):
                alive = alive | live[i]
            if any_in_block(alive) == 0:  # all have read the last batch, too
                break
            load_batch(thread, first, size, splats, pairs, records)
            meet_in_block()
            if vote(alive) == 0:
                size = int(0)
            for part in range((size + lanes() - 1) // lanes()):
                wanted = splats_reaching(records, part * lanes() + lane, size, pixel, thread)
                while wanted != 0:
                    k = part * lanes() + first_lane(wanted)
                    wanted = without_first(wanted)
                    place = quad_at(records, k * _QUADS)
                    form = quad_at(records, k * _QUADS + _FORM)
                    color = quad_at(records, k * _QUADS + _COLOR)
                    for i in range(_PIXELS):
                        if live[i] != 0:
                            dx = float(pixel[0]) + 0.5 - place[0]
                            dy = float(ys[i]) + 0.5 - place[1]
                            raw = uncapped_alpha(form, dx, dy)
                            alpha = capped_and_cut(raw)
                            after = t[i] * (1.0 - alpha)
                            if after < _LEAST:
                                live[i] = int(0)
                                stop[i] = first + k
                            elif alpha > 0.0:
                                weight = t[i] * alpha
                                red[i] = red[i] + weight * color[0]
                                green[i] = green[i] + weight * color[1]
                                blue[i] = blue[i] + weight * color[2]
                                if wp.static(with_depth):
                                    depth[i] = depth[i] + weight * color[3]
                                if wp.static(with_median):
                                    if t[i] > 0.5 and after <= 0.5:
                                        median[i] = color[3]
                                t[i] = after
        for i in range(_PIXELS):
            if pixel[0] < view.width and ys[i] < view.height:
                p = drawn.origin + ys[i] * drawn.pitch + pixel[0]
                drawn.image[p] = red[i] + t[i] * background[0]
                drawn.image[p + drawn.plane] = green[i] + t[i] * background[1]
                drawn.image[p + 2 * drawn.plane] = blue[i] + t[i] * background[2]
                drawn.transmittance[p] = t[i]
                pixel_ends[p] = stop[i]
                if wp.static(with_depth):
                    drawn.depth[p] = wp.where(t[i] < 1.0, depth[i] / (1.0 - t[i]), 0.0)
                if wp.static(with_median):
                    drawn.depth[p + drawn.plane] = median[i]

    return forward


@cache
def backward_cooperative_kernel(with_depth: bool) -> wp.Kernel:
    """Return the kernel in which a block of threads writes the gradient records of one tile.

    To be run by `CooperativeLaunch`.
    """
    fields = COLOR_FIELDS + with_depth
    Record = wp.types.vector(length=fields, dtype=float)
    put_warp_sums = put_sums(fields)

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
        pair_gradients: wp.array2d[float],  # [pairs, fields]
    ):
        """Add the shares of some pixels of a tile to the records of its pairs."""
        tile, thread = wp.tid()
        view = splats.views[0]
        if tile // view.columns >= view.rows:
            return
        begin = pairs.starts[tile]
        end = pairs.starts[tile + 1]
        if begin == end:
            return
        pixel = first_pixel((tile % view.columns) * TILE, (tile // view.columns) * TILE, thread)
        records = shared_records()
        sums = shared_sums()
        lane = thread % lanes()
        own_sums = (thread // lanes()) * _WARP_FLOATS
        t = Floats()
        ahead = Floats()
        v_red = Floats()
        v_green = Floats()
        v_blue = Floats()
        v_depth = Floats()
        ends = Ints()
        ys = Ints()
        last = int(begin)
        for i in range(_PIXELS):
            ys[i] = pixel[1] + i * _ROWS_APART
            t[i] = 1.0
            ends[i] = begin
            if pixel[0] < view.width and ys[i] < view.height:
                p = drawn.origin + ys[i] * drawn.pitch + pixel[0]
                ends[i] = pixel_ends[p]
                last = wp.max(last, ends[i])
                v_red[i] = adjoint.image[p]
                v_green[i] = adjoint.image[p + drawn.plane]
                v_blue[i] = adjoint.image[p + 2 * drawn.plane]
                through = drawn.transmittance[p]
                rest = through * adjoint.transmittance[p] + drawn.image[p] * v_red[i]
                rest += drawn.image[p + drawn.plane] * v_green[i]
                rest += drawn.image[p + 2 * drawn.plane] * v_blue[i]
                if wp.static(with_depth):
                    if through < 1.0:
                        v_depth[i] = adjoint.depth[p] / (1.0 - through)
                    rest += drawn.depth[p] * v_depth[i]
                ahead[i] = rest
        done = int(begin)
        for batch in range((end - begin + _BATCH - 1) // _BATCH):
            first = begin + batch * _BATCH
            size = wp.min(_BATCH, end - first)
            live = wp.where(last > first, int(1), int(0))
            if any_in_block(live) == 0:  # all have read the sums of the last batch, too
                break
            done = first + size
            load_batch(thread, first, size, splats, pairs, records)
            for own in range(lane, size * wp.static(fields), lanes()):
                put_float(sums, own_sums + own, 0.0)
            meet_in_block()
            reached = wp.where(vote(live) == 0, int(0), size)
            for part in range((reached + lanes() - 1) // lanes()):
                wanted = splats_reaching(records, part * lanes() + lane, size, pixel, thread)
                while wanted != 0:
                    k = part * lanes() + first_lane(wanted)
                    wanted = without_first(wanted)
                    place = quad_at(records, k * _QUADS)
                    form = quad_at(records, k * _QUADS + _FORM)
                    color = quad_at(records, k * _QUADS + _COLOR)
                    share = Record()
                    has_share = int(0)
                    # Sums of d_power times 1, dx, dy, dx dx, dx dy, dy dy.
                    sum_1 = float(0.0)
                    sum_x = float(0.0)
                    sum_y = float(0.0)
                    sum_xx = float(0.0)
                    sum_xy = float(0.0)
                    sum_yy = float(0.0)
                    for i in range(_PIXELS):
                        if first + k < ends[i]:
                            dx = float(pixel[0]) + 0.5 - place[0]
                            dy = float(ys[i]) + 0.5 - place[1]
                            raw = uncapped_alpha(form, dx, dy)
                            alpha = capped_and_cut(raw)
                            if alpha > 0.0:
                                has_share = int(1)
                                weight = t[i] * alpha
                                shine = (
                                    color[0] * v_red[i]
                                    + color[1] * v_green[i]
                                    + color[2] * v_blue[i]
                                )
                                if wp.static(with_depth):
                                    shine += color[3] * v_depth[i]
                                    share[wp.static(COLOR_FIELDS)] = (
                                        share[wp.static(COLOR_FIELDS)] + weight * v_depth[i]
                                    )
                                ahead[i] = ahead[i] - weight * shine
                                d_alpha = t[i] * shine - ahead[i] / (1.0 - alpha)
                                d_power = d_alpha * slope_in_power(raw, alpha)
                                d_x = d_power * dx
                                d_y = d_power * dy
                                sum_1 += d_power
                                sum_x += d_x
                                sum_y += d_y
                                sum_xx += d_x * dx
                                sum_xy += d_x * dy
                                sum_yy += d_y * dy
                                share[6] = share[6] + weight * v_red[i]
                                share[7] = share[7] + weight * v_green[i]
                                share[8] = share[8] + weight * v_blue[i]
                                t[i] = t[i] * (1.0 - alpha)
                    if vote(has_share) != 0:
                        share[0] = form[0] * sum_x + form[1] * sum_y
                        share[1] = form[1] * sum_x + form[2] * sum_y
                        share[2] = -0.5 * sum_xx
                        share[3] = -sum_xy
                        share[4] = -0.5 * sum_yy
                        share[5] = sum_1 / form[3]
                        put_warp_sums(share, sums, own_sums + k * wp.static(fields), lane)
            meet_in_block()
            for value in range(thread, size * wp.static(fields), _THREADS):
                total = float(0.0)
                for other in range(_THREADS // lanes()):
                    total += float_at(sums, other * _WARP_FLOATS + value)
                to = pairs.members[first + value // wp.static(fields)][1]
                pair_gradients[to, value % wp.static(fields)] = total
        for rest_k in range(done + thread, end, _THREADS):
            for unused in range(wp.static(fields)):
                pair_gradients[pairs.members[rest_k][1], unused] = 0.0

    return backward


@cache
def sum_records_kernel(fields: int) -> wp.Kernel:
    """Return the kernel in which a warp adds up the records of a splat with more than ``most``.

    The first one holds the sum afterwards. A splat of the background can have a thousand: one thread would
    take longer for them than the others for all other splats. Each lane looks at a splat, and so the number
    of threads is that of whole warps.
    """
    Record = wp.types.vector(length=fields, dtype=float)
    put_warp_sums = put_sums(fields)

    @wp.kernel(name="sum_records", module="unique", module_options={"enable_backward": False})
    def sum_records(first: int, pairs: PairGradients, most: int):
        """Look at one splat, and add up a lane's share of those of its warp that have many records."""
        own = first + wp.tid()
        lane = own % lanes()
        many = int(0)
        if own < pairs.starts.shape[0] - 1:
            if pairs.starts[own + 1] - pairs.starts[own] > most:
                many = int(1)
        wanted = vote(many)
        while wanted != 0:
            g = own - lane + first_lane(wanted)
            wanted = without_first(wanted)
            begin = pairs.starts[g]
            share = Record()
            for pair in range(begin + lane, pairs.starts[g + 1], lanes()):
                for field in range(wp.static(fields)):
                    share[field] = share[field] + pairs.records[pair, field]
            put_warp_sums(share, pairs.records.ptr, begin * wp.static(fields), lane)

    return sum_records
