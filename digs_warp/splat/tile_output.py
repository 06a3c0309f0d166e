"""How a tile is written to the planes of an image: whole vectors, and single pixels at the image's edge."""

import warp as wp

from digs_warp.device.contiguous import floats_from
from digs_warp.splat.tile import BLOCK_COLUMNS, TILE

wp.set_module_options({"enable_backward": False})


@wp.func
def fill_tile(
    start: int, width: int, height: int, pitch: int, value: float, plane: wp.array[float]
):
    """Set the pixels of a tile, of which ``width`` x ``height`` lie inside the image."""
    for y in range(height):
        row = floats_from(plane, start + y * pitch, width)
        if width == TILE:
            for x in range(TILE):
                row[x] = value
        else:
            for t in range(width):
                row[t] = value


@wp.func
def write_row(count: int, source: wp.array[float], first: int, start: int, plane: wp.array[float]):
    """Write ``count`` pixels of one row of a block."""
    taken = floats_from(source, first, count)
    row = floats_from(plane, start, count)
    if count == BLOCK_COLUMNS:
        for x in range(BLOCK_COLUMNS):
            row[x] = taken[x]
    else:
        for t in range(count):
            row[t] = taken[t]
