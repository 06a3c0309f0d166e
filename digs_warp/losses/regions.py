"""Boxes and tiles of pixels: where an image has content, and where a loss has to be computed."""

import numpy as np

from digs_warp.device.image_planes import ALIGNMENT
from digs_warp.geometry.rigid import PixelBox, mask_box
from digs_warp.measure.ssim import BLOCK_COLUMNS, BLOCK_ROWS, REACH

# Tiles are those of the rasterizer.
TILE_SIZE = ALIGNMENT


def union(a: PixelBox, b: PixelBox) -> PixelBox:
    """Return the smallest box around two boxes; an empty box is ignored."""
    if a[0] >= a[2] or a[1] >= a[3]:
        return b
    if b[0] >= b[2] or b[1] >= b[3]:
        return a
    return min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3])


def tiles_of(mask: np.ndarray) -> np.ndarray:
    """Return which tiles of 16x16 px have a pixel above 0, shape (tile rows, tile columns), bool."""
    height, width = mask.shape
    rows, columns = -(-height // TILE_SIZE), -(-width // TILE_SIZE)
    padded = np.zeros((rows * TILE_SIZE, columns * TILE_SIZE), dtype=bool)
    padded[:height, :width] = mask > 0
    strips = padded.reshape(rows, TILE_SIZE, -1).max(axis=1)
    return strips.reshape(rows, columns, TILE_SIZE).max(axis=2)


def blocks_of(tiles: np.ndarray) -> np.ndarray:
    """Return which blocks of the SSIM kernels contain one of ``tiles``, shape (rows, columns), bool."""
    high, wide = BLOCK_ROWS // TILE_SIZE, BLOCK_COLUMNS // TILE_SIZE
    rows, columns = -(-tiles.shape[0] // high), -(-tiles.shape[1] // wide)
    padded = np.zeros((rows * high, columns * wide), dtype=bool)
    padded[: tiles.shape[0], : tiles.shape[1]] = tiles
    return padded.reshape(rows, high, columns, wide).max(axis=(1, 3))


def loss_blocks(content: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """Return the blocks where image and target may differ or a gradient is needed, as `blocks_of` does.

    SSIM differs from 1 up to one window away from a difference, and the gradient reads one window further.
    One extra tile on each side covers both.

    Args:
        content: tiles outside which the target shows only background.
        drawn: tiles outside which the image shows only background.
    """
    differ = content | drawn
    wide = np.zeros((differ.shape[0] + 2, differ.shape[1] + 2), dtype=bool)
    wide[1:-1, 1:-1] = differ
    wide = wide[:-2] | wide[1:-1] | wide[2:]
    return blocks_of(wide[:, :-2] | wide[:, 1:-1] | wide[:, 2:])


def read_region(blocks: np.ndarray, size: tuple[int, int]) -> PixelBox:
    """Return the pixels that the loss of ``blocks`` reads: one window more on every side."""
    x0, y0, x1, y1 = mask_box(blocks)
    pixels = (x0 * BLOCK_COLUMNS, y0 * BLOCK_ROWS, x1 * BLOCK_COLUMNS, y1 * BLOCK_ROWS)
    return grown(pixels, REACH, *size)


def grown(box: PixelBox, margin: int, width: int, height: int) -> PixelBox:
    """Return the box with ``margin`` pixels more on each side, inside an image of the given size."""
    if box[0] >= box[2] or box[1] >= box[3]:
        return 0, 0, 0, 0
    x0, y0 = max(box[0] - margin, 0), max(box[1] - margin, 0)
    return x0, y0, min(box[2] + margin, width), min(box[3] + margin, height)
