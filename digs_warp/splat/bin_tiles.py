"""Which splats touch which tile, front to back: the lists that the rasterizer walks.

The projection gives each splat the box of the tiles that it touches. Splats are sorted by depth, their
(tile, splat) pairs laid out in that order, and the pairs sorted by tile: as both sorts keep the order of
equal keys, every list comes out sorted, and splats of equal depth keep the order of their index. Each splat
writes pairs of its own, so the number of threads changes nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from digs_warp.device.parallel import ParallelLaunch
from digs_warp.geometry.rigid import PixelBox, mask_box
from digs_warp.splat.config import TILE_SIZE
from digs_warp.splat.footprint import ViewParams
from digs_warp.splat.records import COLOR_FIELDS, SPLAT_FIELDS

wp.set_module_options({"enable_backward": False})

# Buffers grow by half when a view needs more: a few growths, then none.
_GROWTH = 1.5


@wp.kernel
def lay_out_kernel(
    first: int,
    centers: wp.array[float],
    boxes: wp.array[wp.vec4i],
    # outputs
    keys: wp.array[float],
    order: wp.array[int],
    counts: wp.array[int],
):
    """Lay out what is sorted by depth, and count the pairs of each splat."""
    g = first + wp.tid()
    keys[g] = centers[g]
    order[g] = g
    counts[g] = boxes[g][2] * boxes[g][3]


@wp.kernel
def reorder_kernel(
    first: int,
    order: wp.array[int],
    counts: wp.array[int],
    # outputs
    ordered: wp.array[int],
):
    """Put the counts in the order of depth."""
    i = first + wp.tid()
    ordered[i] = counts[order[i]]


@wp.kernel
def emit_kernel(
    first: int,
    views: wp.array[ViewParams],
    order: wp.array[int],
    boxes: wp.array[wp.vec4i],
    starts: wp.array[int],  # [n + 1] running sum of the counts, by splat
    places: wp.array[int],  # [n + 1] the same in the order of depth
    # outputs
    tiles: wp.array[int],  # of the pairs
    pairs: wp.array[wp.vec2i],
):
    """Write the pairs of a splat, row by row."""
    i = first + wp.tid()
    g = order[i]
    box = boxes[g]
    pair = starts[g]
    place = places[i]
    for row in range(box[1], box[1] + box[3]):
        for column in range(box[0], box[0] + box[2]):
            tiles[place] = row * views[0].columns + column
            pairs[place] = wp.vec2i(g, pair)
            place += 1
            pair += 1


@wp.kernel
def tile_start_kernel(
    first: int,
    views: wp.array[ViewParams],
    total: wp.array[int],  # [1] number of pairs
    tiles: wp.array[int],  # sorted
    # outputs
    tile_starts: wp.array[int],  # [tiles + 1]
):
    """Find where the list of a tile begins: by halving what is left."""
    tile = first + wp.tid()
    if tile > views[0].columns * views[0].rows:
        return
    low = int(0)
    high = total[0]
    while low < high:
        middle = (low + high) // 2
        if tiles[middle] < tile:
            low = middle + 1
        else:
            high = middle
    tile_starts[tile] = low


@dataclass
class TileLists:
    """Device arrays of one view. Pairs are (tile, splat)."""

    splats: wp.array  # [n, SPLAT_FIELDS]
    centers: wp.array  # [n] planar depth [m], 0 if it is not drawn
    depths: wp.array  # [n]
    boxes: wp.array  # [n] vec4i: first tile column and row, then how many
    pair_starts: wp.array  # [n + 1] pairs are numbered splat by splat: their gradients are read so
    tile_starts: wp.array  # [tiles + 1]
    # Twice as long as there are pairs: the sort needs as much to work in.
    tiles: wp.array  # [2 capacity]
    pairs: wp.array  # [2 capacity] vec2i: splat, and the number of the pair
    pair_blocks: wp.array  # [capacity] blocks drawn, by `digs_warp.splat.rasterize`
    pair_gradients: wp.array  # [capacity, gradient fields], by number


class TileBinner:
    """Builds `TileLists` for views up to one size; call `bin` after every projection.

    Args:
        count: number of Gaussians.
        width, height: size of the largest view [px].
        views: the view (one `ViewParams`) that the projection reads; call `resize` when its size changes.
        gradient_fields: length of the gradient record of a pair.
        threads: CPU threads; 0 means all cores.

    ``generation`` counts reallocations: launches recorded on the lists are stale when it changes.
    """

    def __init__(
        self,
        count: int,
        width: int,
        height: int,
        views: wp.array,
        gradient_fields: int = COLOR_FIELDS,
        threads: int = 0,
    ) -> None:
        self.device = device = str(views.device)
        self.count = count
        self._views = views
        self._gradient_fields = gradient_fields
        self._threads = threads
        self.generation = 0
        self.total_pairs = 0
        self.resize(width, height)
        n = max(count, 1)
        self._keys = wp.zeros(2 * n, dtype=float, device=device)
        self._order = self._zeros(2 * n)
        self._counts, self._ordered = self._zeros(n), self._zeros(n)
        self._places = self._zeros(n + 1)
        # Pinned: a copy from a GPU need not go by other memory, and makes none.
        self._total = wp.zeros(1, dtype=int, device="cpu", pinned=device != "cpu")
        capacity = 3 * n + 64  # a splat of a dense object touches about two tiles
        self.lists = TileLists(
            splats=_on_cache_lines(n, SPLAT_FIELDS, device),
            centers=wp.zeros(n, dtype=float, device=device),
            depths=wp.zeros(n, dtype=float, device=device),
            boxes=wp.zeros(n, dtype=wp.vec4i, device=device),
            pair_starts=self._zeros(n + 1),
            tile_starts=self._zeros(self.tiles + 1),
            **self._for_pairs(capacity),
        )
        self._record()

    def resize(self, width: int, height: int) -> None:
        """Take views of another size from now on, up to that of the constructor."""
        self.width = width
        self.height = height
        self.columns = -(-width // TILE_SIZE)
        self.rows = -(-height // TILE_SIZE)
        self.tiles = self.columns * self.rows

    def bin(self) -> None:
        """Build the lists from the ``boxes`` and ``centers`` of the splats."""
        lists = self.lists
        self._lay_out.run()
        wp.utils.radix_sort_pairs(self._keys, self._order, self.count)
        self._reorder.run()
        for counts, starts in ((self._counts, lists.pair_starts), (self._ordered, self._places)):
            wp.utils.array_scan(counts, starts[1:])  # pyright: ignore[reportArgumentType]
        wp.copy(self._total, self._places, src_offset=self.count, count=1)
        wp.synchronize_stream(self.device)
        self.total_pairs = int(self._total.numpy()[0])
        if self.total_pairs > len(lists.pair_blocks):
            vars(lists).update(self._for_pairs(int(self.total_pairs * _GROWTH)))
            self._record()
        self._emit.run()
        bits = self.tiles.bit_length()
        wp.utils.radix_sort_pairs(lists.tiles, lists.pairs, self.total_pairs, end_bit=bits)
        self._begin.run()

    def drawn_tiles(self) -> np.ndarray:
        """Return which tiles have splats, shape (rows, columns), bool."""
        starts = self.lists.tile_starts.numpy()[: self.tiles + 1]
        return np.diff(starts).reshape(self.rows, self.columns) > 0

    def drawn_box(self) -> PixelBox:
        """Return the pixels (x0, y0, x1, y1) of the tiles that have splats; all 0 when none has."""
        return pixels_of(self.drawn_tiles(), self.width, self.height)

    def _for_pairs(self, capacity: int) -> dict[str, wp.array]:
        """Return the buffers that hold so many pairs."""
        fields, device = self._gradient_fields, self.device
        return {
            "tiles": self._zeros(2 * capacity),
            "pairs": wp.zeros(2 * capacity, dtype=wp.vec2i, device=device),
            "pair_blocks": self._zeros(capacity),
            "pair_gradients": wp.zeros((capacity, fields), dtype=float, device=device),
        }

    def _record(self) -> None:
        """Record the launches on the present buffers."""
        lists, n = self.lists, self.count
        self.generation += 1

        def launch(kernel: Any, dim: int, inputs: list[Any]) -> ParallelLaunch:
            return ParallelLaunch(kernel, dim, inputs, self.device, self._threads, even=True)

        laid_out = [self._keys, self._order, self._counts]
        self._lay_out = launch(lay_out_kernel, n, [lists.centers, lists.boxes, *laid_out])
        self._reorder = launch(reorder_kernel, n, [self._order, self._counts, self._ordered])
        given = [self._views, self._order, lists.boxes, lists.pair_starts, self._places]
        self._emit = launch(emit_kernel, n, [*given, lists.tiles, lists.pairs])
        last = self._places[n:]
        given = [self._views, last, lists.tiles, lists.tile_starts]
        self._begin = launch(tile_start_kernel, len(lists.tile_starts), given)

    def _zeros(self, count: int) -> wp.array:
        return wp.zeros(count, dtype=int, device=self.device)


# Tiles around content and splats that are filled with the background: a loss with windows looks there, too.
# That of training reads one tile, the rest of a block of 64 px and 5 px more.
FILLED_AROUND = 5


def tiles_with_background(boxes: Sequence[PixelBox] | None, columns: int, rows: int) -> np.ndarray:
    """Return the tile columns first .. end and rows first .. end that show the background, (4,) int32.

    Args:
        boxes: pixels that are looked at; those around are, too. None: the whole image.
        columns: of tiles in the image.
        rows: of tiles in the image.
    """
    if boxes is None:
        return np.array([0, columns, 0, rows], dtype=np.int32)
    found = np.array(boxes)
    found = found[(found[:, 0] < found[:, 2]) & (found[:, 1] < found[:, 3])]
    if not len(found):
        return np.zeros(4, dtype=np.int32)
    x0, y0 = found[:, :2].min(axis=0) // TILE_SIZE - FILLED_AROUND
    x1, y1 = -(-found[:, 2:].max(axis=0) // TILE_SIZE) + FILLED_AROUND
    return np.array([x0, x1, y0, y1], dtype=np.int32)


def pixels_of(tiles: np.ndarray, width: int, height: int) -> PixelBox:
    """Return the box of the tiles that are true, (rows, columns), in an image of the given size [px]."""
    x0, y0, x1, y1 = (edge * TILE_SIZE for edge in mask_box(tiles))
    return x0, y0, min(x1, width), min(y1, height)


def _on_cache_lines(count: int, fields: int, device: str) -> wp.array:
    """Return zeros (count, fields) that begin on a boundary of 64 bytes."""
    line = 16
    memory = wp.zeros(count * fields + line, dtype=float, device=device)
    skip = -(int(memory.ptr or 0) // 4) % line
    rows = memory[skip : skip + count * fields].reshape((count, fields))  # pyright: ignore[reportAttributeAccessIssue]
    return rows
