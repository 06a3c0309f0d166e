"""Which splats touch which tile, front to back: the lists that the rasterizer walks.

Per splat and tile row, the exact range of tiles that its ellipse {alpha >= MIN_ALPHA} touches is computed
once and stored (a *span*), so that counting and emitting can never disagree. Splats are then sorted by
depth once, and dealt out to the tiles in that order: every tile list comes out sorted, without a sort of
the (tile, splat) pairs. Each thread deals out its part of the order and knows from counting where the parts
before it end in each tile, so nothing is written twice.

`TileBinner(counting=False)` reaches the same lists by one sort of (tile, depth) keys: the path for CUDA,
and the twin that the counting path is tested against. Splats of equal depth keep the order of their index.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from digs_warp.checks import DigsError
from digs_warp.device.parallel import ParallelLaunch, default_threads, recorded, run_together
from digs_warp.geometry.rigid import PixelBox, mask_box
from digs_warp.splat.bin_kernels import (
    emit_kernel,
    exclusive_scan_kernel,
    pair_key_kernel,
    pair_scan_kernel,
    span_kernel,
    tile_count_kernel,
    tile_scan_kernel,
    unpack_kernel,
)
from digs_warp.splat.config import EXTENT_SLACK, TILE_SIZE
from digs_warp.splat.depth_sort import HISTOGRAM, depth_sort_kernel
from digs_warp.splat.records import COLOR_FIELDS, GROUP_SIZE, SPLAT_FIELDS
from digs_warp.splat.span_group import span_group_kernel
from digs_warp.splat.spans import MAX_TILE_COLUMNS

# Buffers grow by half when a view needs more: a few growths, then none.
_GROWTH = 1.5


@dataclass
class TileLists:
    """Device arrays of one view. Pairs are (tile, splat); ``rows`` are (splat, tile row) spans."""

    splats: wp.array  # [n, SPLAT_FIELDS]
    depths: wp.array  # [n]
    first_tile_rows: wp.array  # [n]
    row_counts: wp.array  # [n]
    row_starts: wp.array  # [n + 1]
    pair_counts: wp.array  # [n]
    pair_starts: wp.array  # [n + 1]
    tile_changes: (
        wp.array
    )  # [parts, tiles + 1] by how many splats a tile has more than the one before
    tile_starts: wp.array  # [tiles + 1]
    cursors: wp.array  # [parts, tiles]
    ranges: wp.array  # [n] vec4i: first tile row, first span, number of spans, first pair
    spans: wp.array  # [row capacity] vec2i
    tile_splats: wp.array  # [pair capacity]
    tile_pairs: wp.array  # [pair capacity] numbers of the same pairs, counted by splat
    pair_blocks: wp.array  # [pair capacity] blocks drawn, by `digs_warp.splat.rasterize`
    pair_gradients: wp.array  # [pair capacity, gradient fields], by splat


class TileBinner:
    """Builds `TileLists` for views up to one size; call `bin` after every projection.

    Args:
        count: number of Gaussians.
        width, height: size of the largest view [px].
        views: the view (one `ViewParams`) that the projection reads; call `resize` when its size changes.
        gradient_fields: length of the gradient record of a pair.
        threads: CPU threads; 0 means all cores.
        counting: deal splats out in depth order (CPU); False: sort keys (CUDA).

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
        counting: bool = True,
    ) -> None:
        device = str(views.device)
        self._views = views
        self._gradient_fields = gradient_fields
        self.resize(width, height)
        self._capacity = self.tiles
        if self.columns >= MAX_TILE_COLUMNS:
            raise DigsError(
                f"image width {width}: expected below {MAX_TILE_COLUMNS * TILE_SIZE} px"
            )
        self.count = count
        self.device = device
        self.threads = threads or default_threads()
        self.counting = counting
        self._parts = self.threads if counting else 1
        self.generation = 0
        self.total_rows = 0
        self.total_pairs = 0
        # Pinned: a copy from a GPU need not go by other memory, and makes none.
        self._total = wp.zeros(1, dtype=int, device="cpu", pinned=device != "cpu")
        self._order = wp.zeros(max(count, 1), dtype=wp.vec2i, device=device)
        self._spare = wp.zeros_like(self._order)
        self._histogram = self._zeros(HISTOGRAM)
        self._sorted_count = self._zeros(1)
        self.lists = self._allocate()

    def resize(self, width: int, height: int) -> None:
        """Take views of another size from now on, up to that of the constructor."""
        self.width = width
        self.height = height
        self.columns = -(-width // TILE_SIZE)
        self.rows = -(-height // TILE_SIZE)
        self.tiles = self.columns * self.rows

    def bin(self) -> TileLists:
        """Build the lists from ``splats``, ``depths``, ``first_tile_rows`` and ``row_counts``."""
        if self.counting:
            self._bin_by_counting()
        else:
            self._bin_by_sorting()
        return self.lists

    def drawn_tiles(self) -> np.ndarray:
        """Return which tiles have splats, shape (rows, columns), bool."""
        starts = self.lists.tile_starts.numpy()[: self.tiles + 1]
        return np.diff(starts).reshape(self.rows, self.columns) > 0

    def drawn_box(self) -> PixelBox:
        """Return the pixels (x0, y0, x1, y1) of the tiles that have splats; all 0 when none has."""
        return pixels_of(self.drawn_tiles(), self.width, self.height)

    def _bin_by_counting(self) -> None:
        lists = self.lists
        self._row_scan.launch()
        self._hold_rows(lists.row_starts.numpy()[self.count])
        run_together([self._sort_launch, self._span_launch])
        self._number_pairs.launch()
        self._hold_pairs(lists.pair_starts.numpy()[self.count])
        lists.tile_changes.zero_()
        self._count_launch.run()
        self._tile_scan.set_param_at_index(1, self.tiles)
        self._tile_scan.launch()
        self._emit_launch.run()

    def _bin_by_sorting(self) -> None:
        lists = self.lists
        self._hold_rows(self._running_sum(lists.row_counts, lists.row_starts))
        self._span_launch.run()
        self._hold_pairs(self._running_sum(lists.pair_counts, lists.pair_starts))
        pairs = self.total_pairs
        self._key_launch.set_param(0, self.columns)
        self._key_launch.run()
        tile_bits = self.tiles.bit_length()
        wp.utils.radix_sort_pairs(self._keys, self._values, pairs, end_bit=32 + tile_bits)
        wp.launch(
            unpack_kernel,
            dim=pairs + 1,
            inputs=[pairs, self.tiles, self._keys, self._values, self._pair_splats],
            outputs=[lists.tile_splats, lists.tile_pairs, lists.tile_starts],
            device=self.device,
            record_tape=False,
        )

    def _running_sum(self, counts: wp.array, starts: wp.array) -> int:
        """Fill ``starts`` behind its first 0, and return the total; waits for the device."""
        wp.utils.array_scan(counts, starts[1:])  # pyright: ignore[reportArgumentType]
        wp.copy(self._total, starts, src_offset=self.count, count=1)
        wp.synchronize_stream(self.device)
        return int(self._total.numpy()[0])

    def _hold_rows(self, total: int) -> None:
        """Make room for the spans of a view."""
        self.total_rows = int(total)
        if self.total_rows > len(self.lists.spans):
            self._grow_rows()

    def _hold_pairs(self, total: int) -> None:
        """Make room for the pairs of a view."""
        self.total_pairs = int(total)
        if self.total_pairs > len(self.lists.tile_splats):
            self._grow_pairs()

    def _allocate(self) -> TileLists:
        n = max(self.count, 1)
        # A splat of a dense object touches about two rows and three tiles.
        rows, pairs = 2 * n + 64, 3 * n + 64
        lists = TileLists(
            splats=_on_cache_lines(n, SPLAT_FIELDS, self.device),
            depths=wp.zeros(n, dtype=float, device=self.device),
            first_tile_rows=self._zeros(n),
            row_counts=self._zeros(n),
            row_starts=self._zeros(n + 1),
            pair_counts=self._zeros(n),
            pair_starts=self._zeros(n + 1),
            tile_changes=self._zeros_by_part(),
            tile_starts=self._zeros(self._capacity + 1),
            cursors=self._zeros_by_part(),
            ranges=wp.zeros(n, dtype=wp.vec4i, device=self.device),
            spans=self._make_spans(rows),
            tile_splats=self._zeros(pairs),
            tile_pairs=self._zeros(pairs),
            pair_blocks=self._zeros(pairs),
            pair_gradients=wp.zeros(
                (pairs, self._gradient_fields), dtype=float, device=self.device
            ),
        )
        self.lists = lists
        self._make_keys(pairs)
        self._record()
        return lists

    def _grow_rows(self) -> None:
        capacity = int(self.total_rows * _GROWTH)
        self.lists.spans = self._make_spans(capacity)
        self._record()

    def _grow_pairs(self) -> None:
        capacity = int(self.total_pairs * _GROWTH)
        lists = self.lists
        lists.tile_splats = self._zeros(capacity)
        lists.tile_pairs = self._zeros(capacity)
        lists.pair_blocks = self._zeros(capacity)
        lists.pair_gradients = wp.zeros(
            (capacity, self._gradient_fields), dtype=float, device=self.device
        )
        self._make_keys(capacity)
        self._record()

    def _make_keys(self, pairs: int) -> None:
        """Make what is sorted, twice as long as there are pairs: the sort needs as much to work in."""
        pairs = 0 if self.counting else pairs
        self._keys = wp.zeros(2 * pairs, dtype=wp.int64, device=self.device)  # pyright: ignore[reportArgumentType]
        self._values = self._zeros(2 * pairs)
        self._pair_splats = self._zeros(pairs)

    def _record(self) -> None:
        """Record the launches on the present buffers."""
        lists = self.lists
        self.generation += 1
        self._row_scan = self._serial(
            exclusive_scan_kernel, [lists.row_counts, self.count, lists.row_starts]
        )
        self._tile_scan = self._serial(
            tile_scan_kernel,
            [self._parts, self.tiles, lists.tile_changes, lists.cursors, lists.tile_starts],
        )
        self._number_pairs = self._serial(
            pair_scan_kernel,
            [self.count, lists.first_tile_rows, lists.row_starts, lists.pair_counts]
            + [lists.pair_starts, lists.ranges],
        )
        self._sort_launch = self._launch(
            depth_sort_kernel,
            1 if self.counting else 0,
            [self.count, lists.depths, lists.row_counts, self._histogram, self._spare]
            + [self._order, self._sorted_count],
        )
        self._span_launch = self._launch(
            span_group_kernel if self.counting else span_kernel,
            -(-self.count // GROUP_SIZE) if self.counting else self.count,
            [self._views, lists.splats, lists.first_tile_rows, lists.row_starts, EXTENT_SLACK]
            + [lists.spans, lists.pair_counts],
        )
        self._key_launch = self._launch(
            pair_key_kernel,
            0 if self.counting else self.count,
            [self.columns, lists.first_tile_rows, lists.row_starts, lists.pair_starts]
            + [lists.spans, lists.depths, self._keys, self._values, self._pair_splats],
        )
        parts = [self._views, self._parts, self._sorted_count, self._order]
        parts += [lists.ranges, lists.spans]
        self._count_launch = self._launch(
            tile_count_kernel, self._parts, [*parts, lists.tile_changes]
        )
        self._emit_launch = self._launch(
            emit_kernel,
            self._parts,
            [*parts, lists.cursors, lists.tile_splats, lists.tile_pairs],
        )

    def _launch(self, kernel: Any, dim: int, inputs: list[Any]) -> ParallelLaunch:
        return ParallelLaunch(kernel, dim, inputs, self.device, self.threads, even=True)

    def _serial(self, kernel: Any, inputs: list[Any]) -> Any:
        """Record a kernel that runs in one thread; `launch` on what is returned runs it."""
        return recorded(kernel, 1, inputs, self.device)

    def _make_spans(self, count: int) -> wp.array:
        return wp.zeros(count, dtype=wp.vec2i, device=self.device)

    def _zeros_by_part(self) -> wp.array:
        return wp.zeros((self._parts, self._capacity + 1), dtype=int, device=self.device)

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
