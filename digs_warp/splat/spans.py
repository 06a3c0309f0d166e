"""Spans: the tile columns that a splat touches in one tile row, and the loops over all tiles of a splat.

A span is a pair of integers: the packed columns, and how many (tile, splat) pairs the splat has before it.
The loops are native: finding the place of an index in a Warp array would take longer than the work itself.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})

# Packed are the first and one past the last tile column: images up to 2^19 px wide.
_BITS = 15
MAX_TILE_COLUMNS = 1 << _BITS
_MASK = MAX_TILE_COLUMNS - 1

_SPAN_BITS = wp.constant(_BITS)
_FIRST = wp.constant(_MASK)


@wp.func
def span_of(first: int, end: int) -> int:
    """Pack the columns from ``first`` to before ``end``."""
    return first | (end << _SPAN_BITS)


@wp.func
def span_first(span: int) -> int:
    """First tile column of a packed span."""
    return span & _FIRST


@wp.func
def span_end(span: int) -> int:
    """One past the last tile column of a packed span."""
    return span >> _SPAN_BITS


# What is drawn of a splat: first tile row, first span, number of spans, first pair. Strides are in bytes.
_COUNT = f"""
int* here = counts.data + part * (counts.strides[0] >> 2) + drawn[0] * columns;
const wp::vec2i* span = spans.data + drawn[1];
for (int row = 0; row < drawn[2]; ++row, ++span, here += columns) {{
    ++here[(*span)[0] & {_MASK}];
    --here[(*span)[0] >> {_BITS}];
}}
"""


@wp.func_native(_COUNT)
def count_tiles(
    drawn: wp.vec4i,
    columns: int,
    spans: wp.array[wp.vec2i],
    part: int,
    counts: wp.array2d[int],
):
    """Add 1 where the tiles of a splat begin, and -1 behind them; a row of the image has ``columns`` tiles.

    Running sums over all tiles, row after row, are how many splats each has.
    """
    ...


_DEAL = f"""
int* here = cursors.data + part * (cursors.strides[0] >> 2) + drawn[0] * columns;
const wp::vec2i* span = spans.data + drawn[1];
int* splats = tile_splats.data;
int* pairs = tile_pairs.data;
for (int row = 0; row < drawn[2]; ++row, ++span, here += columns) {{
    const int end = (*span)[0] >> {_BITS};
    int pair = drawn[3] + (*span)[1];
    for (int column = (*span)[0] & {_MASK}; column < end; ++column, ++pair) {{
        const int slot = here[column]++;
        splats[slot] = splat;
        pairs[slot] = pair;
    }}
}}
"""


@wp.func_native(_DEAL)
def deal_out(
    splat: int,
    drawn: wp.vec4i,
    columns: int,
    spans: wp.array[wp.vec2i],
    part: int,
    cursors: wp.array2d[int],
    tile_splats: wp.array[int],
    tile_pairs: wp.array[int],
):
    """Put a splat where the cursors of its tiles point, with the number of each pair, and move them on."""
    ...
