"""Kernels of `digs_warp.splat.bin_tiles`: spans, counts, and the two ways to build the tile lists."""

import warp as wp

from digs_warp.device.elementary import larger, smaller
from digs_warp.splat.config import TILE_SIZE
from digs_warp.splat.footprint import ViewParams
from digs_warp.splat.records import (
    SPLAT_A,
    SPLAT_B,
    SPLAT_C,
    SPLAT_HALF_HEIGHT,
    SPLAT_HALF_WIDTH,
    SPLAT_TAU,
    SPLAT_U,
    SPLAT_V,
)
from digs_warp.splat.spans import count_tiles, deal_out, span_end, span_first, span_of

wp.set_module_options({"enable_backward": False})

_TILE = wp.constant(TILE_SIZE)
_TILE_BITS = wp.constant(TILE_SIZE.bit_length() - 1)


@wp.func
def half_chord(share: float, widest: float) -> float:
    """Half the width of the ellipse, at a height as a share of its half height, -1 .. 1."""
    return widest * wp.sqrt(larger(0.0, 1.0 - share * share))


@wp.func
def outline_of(conic: wp.vec3, tau: float, half: wp.vec2) -> wp.vec4:
    """What all spans of an ellipse follow from; ``half`` of its width and height are given.

    That is its shear, half its longest chord, 1 / half its height, and the height above its center at which
    it is furthest to the right.
    """
    shear = conic[1] / conic[0]
    widest = wp.sqrt(tau / conic[0])
    return wp.vec4(shear, widest, 1.0 / half[1], -half[0] * conic[1] / conic[2])


@wp.func
def drawn_columns(cam: ViewParams) -> wp.vec2:
    """The first and the last pixel column of the drawn tiles, exact as floats."""
    right = wp.min(cam.end_column * _TILE, cam.width) - 1
    return wp.vec2(float(cam.first_column * _TILE), float(right))


@wp.func
def columns_in_row(
    center: wp.vec2,
    half: wp.vec2,
    outline: wp.vec4,
    tile_row: int,
    slack: float,
    drawn: wp.vec2,
) -> wp.vec2i:
    """The drawn tile columns, first and one past the last, that an ellipse touches in a tile row."""
    top = float(tile_row * _TILE) + 0.5 - center[1]
    low = larger(top, -half[1])
    high = smaller(top + float(_TILE - 1), half[1])
    dy_right = larger(smaller(outline[3], high), low)
    dy_left = larger(smaller(-outline[3], high), low)
    right = -outline[0] * dy_right + half_chord(dy_right * outline[2], outline[1])
    left = -outline[0] * dy_left - half_chord(dy_left * outline[2], outline[1])
    right = smaller(right, half[0]) + slack
    left = larger(left, -half[0]) - slack
    # Pixel centers lie at +0.5. Clamped as floats: a huge splat would overflow an integer.
    x0 = int(larger(wp.ceil(center[0] + left - 0.5), drawn[0]))
    x1 = int(smaller(wp.floor(center[0] + right - 0.5), drawn[1]))
    t0 = x0 >> _TILE_BITS
    touches = low <= high and x0 <= x1
    return wp.vec2i(t0, wp.where(touches, (x1 >> _TILE_BITS) + 1, t0))


@wp.kernel
def span_kernel(
    first: int,
    views: wp.array[ViewParams],  # [1]
    splats: wp.array2d[float],  # [n, SPLAT_FIELDS]
    first_tile_rows: wp.array[int],  # [n]
    row_starts: wp.array[int],  # [n + 1] spans of splat g: row_starts[g] .. row_starts[g + 1]
    slack: float,
    # outputs
    spans: wp.array[wp.vec2i],  # [rows] packed tile columns; pairs of the splat before this span
    pair_counts: wp.array[int],  # [n]
):
    """Find the drawn tile columns that each splat touches in each of its tile rows."""
    g = first + wp.tid()
    drawn = drawn_columns(views[0])
    pairs = int(0)
    begin = row_starts[g]
    end = row_starts[g + 1]
    if begin < end:
        center = wp.vec2(splats[g, SPLAT_U], splats[g, SPLAT_V])
        half = wp.vec2(splats[g, SPLAT_HALF_WIDTH], splats[g, SPLAT_HALF_HEIGHT])
        conic = wp.vec3(splats[g, SPLAT_A], splats[g, SPLAT_B], splats[g, SPLAT_C])
        outline = outline_of(conic, splats[g, SPLAT_TAU], half)
        for row in range(begin, end):
            tile_row = first_tile_rows[g] + row - begin
            touched = columns_in_row(center, half, outline, tile_row, slack, drawn)
            spans[row] = wp.vec2i(span_of(touched[0], touched[1]), pairs)
            pairs += touched[1] - touched[0]
    pair_counts[g] = pairs


@wp.kernel
def exclusive_scan_kernel(counts: wp.array[int], count: int, starts: wp.array[int]):
    """Running sum; ``starts`` has one element more than ``counts``. One thread."""
    total = int(0)
    for i in range(count):
        starts[i] = total
        total += counts[i]
    starts[count] = total


@wp.kernel
def pair_scan_kernel(
    count: int,
    first_tile_rows: wp.array[int],
    row_starts: wp.array[int],
    pair_counts: wp.array[int],
    # outputs
    pair_starts: wp.array[int],  # [n + 1] running sum of the counts
    ranges: wp.array[wp.vec4i],  # [n] first tile row, first span, number of spans, first pair
):
    """Number the pairs; and lay side by side what dealing out asks of splats in any order. One thread."""
    total = int(0)
    for g in range(count):
        pair_starts[g] = total
        begin = row_starts[g]
        ranges[g] = wp.vec4i(first_tile_rows[g], begin, row_starts[g + 1] - begin, total)
        total += pair_counts[g]
    pair_starts[count] = total


# While one splat is dealt out, what others will need is asked for: in the order of depth they lie anywhere.
_RANGES_AHEAD = wp.constant(16)
_SPANS_AHEAD = wp.constant(8)

_PREFETCH = """
#if !defined(__CUDA_ARCH__)
__builtin_prefetch(values.data + index);
#endif
"""


@wp.func_native(_PREFETCH)
def prefetch_range(values: wp.array[wp.vec4i], index: int):
    """Ask for the range of a splat before it is read."""
    ...


@wp.func_native(_PREFETCH)
def prefetch_span(values: wp.array[wp.vec2i], index: int):
    """Ask for a span before it is read."""
    ...


@wp.func
def range_in_order(
    i: int,
    last: int,
    order: wp.array[wp.vec2i],
    ranges: wp.array[wp.vec4i],
    spans: wp.array[wp.vec2i],
) -> wp.vec4i:
    """Range of the ``i``-th splat; asks for what those behind it, up to ``last``, will need."""
    prefetch_range(ranges, order[wp.min(i + _RANGES_AHEAD, last)][1])
    prefetch_span(spans, ranges[order[wp.min(i + _SPANS_AHEAD, last)][1]][1])
    return ranges[order[i][1]]


@wp.func
def part_start(counts: wp.array[int], part: int, parts: int) -> int:
    """Where one of ``parts`` equal parts of the order begins."""
    return counts[0] * part // parts


@wp.kernel
def tile_count_kernel(
    first: int,
    views: wp.array[ViewParams],
    parts: int,
    counts: wp.array[int],  # [1] length of the order
    order: wp.array[wp.vec2i],  # sorting key and splat, nearest first
    ranges: wp.array[wp.vec4i],
    spans: wp.array[wp.vec2i],
    # outputs
    tile_changes: wp.array2d[int],  # [parts, tiles of the largest view + 1], 0 before
):
    """Count by how many splats a tile has more than the one before it, in one of ``parts`` of the order."""
    part = first + wp.tid()
    columns = views[0].columns
    end = part_start(counts, part + 1, parts)
    for i in range(part_start(counts, part, parts), end):
        drawn = range_in_order(i, end - 1, order, ranges, spans)
        count_tiles(drawn, columns, spans, part, tile_changes)


@wp.kernel
def tile_scan_kernel(
    parts: int,
    tiles: int,
    tile_changes: wp.array2d[int],  # [parts, tiles of the largest view + 1]; lost
    # outputs
    cursors: wp.array2d[int],  # [parts, tiles] where a part's splats of a tile begin
    tile_starts: wp.array[int],  # [tiles + 1]
):
    """Running sum over the tiles, and over the parts within each. One thread."""
    total = int(0)
    for tile in range(tiles):
        tile_starts[tile] = total
        for part in range(parts):
            cursors[part, tile] = total
            count = tile_changes[part, tile]
            tile_changes[part, tile + 1] = tile_changes[part, tile + 1] + count
            total += count
    tile_starts[tiles] = total


@wp.kernel
def emit_kernel(
    first: int,
    views: wp.array[ViewParams],
    parts: int,
    counts: wp.array[int],
    order: wp.array[wp.vec2i],
    ranges: wp.array[wp.vec4i],
    spans: wp.array[wp.vec2i],
    # outputs
    cursors: wp.array2d[int],
    tile_splats: wp.array[int],  # [pairs] splats by tile, nearest first
    tile_pairs: wp.array[int],  # [pairs] the number of each pair when counted by splat
):
    """Deal the splats of one part of the order out to the tiles."""
    part = first + wp.tid()
    columns = views[0].columns
    end = part_start(counts, part + 1, parts)
    for i in range(part_start(counts, part, parts), end):
        drawn = range_in_order(i, end - 1, order, ranges, spans)
        deal_out(order[i][1], drawn, columns, spans, part, cursors, tile_splats, tile_pairs)


@wp.kernel
def pair_key_kernel(
    first: int,
    columns: int,
    first_tile_rows: wp.array[int],
    row_starts: wp.array[int],
    pair_starts: wp.array[int],
    spans: wp.array[wp.vec2i],
    depths: wp.array[float],
    # outputs
    keys: wp.array[wp.int64],
    pairs: wp.array[int],
    pair_splats: wp.array[int],
):
    """One (tile, depth) key per pair, one thread per splat."""
    g = first + wp.tid()
    begin = row_starts[g]
    for row in range(begin, row_starts[g + 1]):
        span = spans[row]
        x0 = span_first(span[0])
        for column in range(x0, span_end(span[0])):
            pair = pair_starts[g] + span[1] + column - x0
            tile = (first_tile_rows[g] + row - begin) * columns + column
            keys[pair] = (wp.int64(tile) << wp.int64(32)) | wp.int64(wp.cast(depths[g], wp.int32))
            pairs[pair] = pair
            pair_splats[pair] = g


@wp.kernel
def unpack_kernel(
    count: int,
    tiles: int,
    keys: wp.array[wp.int64],
    pairs: wp.array[int],
    pair_splats: wp.array[int],
    # outputs
    tile_splats: wp.array[int],
    tile_pairs: wp.array[int],
    tile_starts: wp.array[int],  # [tiles + 1]
):
    """Turn ``count`` sorted keys into tile lists; one thread more than keys, which ends the last lists."""
    slot = wp.tid()
    before = int(-1)
    tile = int(tiles)
    if slot > 0:
        before = int(keys[slot - 1] >> wp.int64(32))
    if slot < count:
        tile = int(keys[slot] >> wp.int64(32))
        pair = pairs[slot]
        tile_splats[slot] = pair_splats[pair]
        tile_pairs[slot] = pair
    for begun in range(before + 1, tile + 1):
        tile_starts[begun] = slot
