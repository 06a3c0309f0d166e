"""A splat is drawn in every block of a tile that it touches, and in few others."""

import numpy as np
import pytest

from digs_warp.splat.config import BLOCK_HEIGHT, BLOCK_WIDTH, DEFAULT_OPTIONS, TILE_SIZE
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.records import (
    SPLAT_A,
    SPLAT_B,
    SPLAT_C,
    SPLAT_OPACITY,
    SPLAT_U,
    SPLAT_V,
)
from digs_warp.splat.renderer import SplatRenderer
from reference.splat_scenes import NEAR, camera, random_gaussians

SIZE = (16 * 12, 16 * 9)  # whole tiles


def drawn_blocks(stretch: float, opacity_logit: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which blocks were drawn, their largest alpha (both by pair), and the tiles of the pairs."""
    gaussians = random_gaussians(400, seed=3)
    gaussians.log_scales[:, 0] += stretch
    gaussians.opacity_logits[:] = opacity_logit
    renderer = SplatRenderer(DeviceGaussians.from_numpy(gaussians), *SIZE)
    renderer.forward(camera(*SIZE, fx=170.0, fy=170.0), near=NEAR)
    binner, lists = renderer.binner, renderer.binner.lists
    starts = np.array(lists.tile_starts.numpy(), dtype=int)[: binner.tiles + 1]
    tiles = np.repeat(np.arange(binner.tiles), np.diff(starts))
    pairs = len(tiles)
    bits = np.array(lists.pair_blocks.numpy(), dtype=int)[:pairs]
    splats = np.array(lists.splats.numpy(), dtype=np.float64)
    members = np.array(lists.tile_splats.numpy(), dtype=int)[:pairs]
    splats = splats[members, :, None, None]
    corners = np.stack([tiles % binner.columns, tiles // binner.columns]) * TILE_SIZE
    x, y = np.meshgrid(np.arange(TILE_SIZE), np.arange(TILE_SIZE))
    dx = x + corners[0][:, None, None] + 0.5 - splats[:, SPLAT_U]
    dy = y + corners[1][:, None, None] + 0.5 - splats[:, SPLAT_V]
    power = splats[:, SPLAT_A] * dx**2 + splats[:, SPLAT_C] * dy**2
    alpha = splats[:, SPLAT_OPACITY] * np.exp(-0.5 * power - splats[:, SPLAT_B] * dx * dy)
    halves = alpha.reshape(
        pairs, TILE_SIZE // BLOCK_HEIGHT, BLOCK_HEIGHT, TILE_SIZE // BLOCK_WIDTH, BLOCK_WIDTH
    )
    largest = halves.max(axis=(2, 4)).transpose(0, 2, 1).reshape(pairs, -1)
    drawn = (bits[:, None] >> np.arange(largest.shape[1])) & 1 != 0
    return drawn, largest, tiles


@pytest.mark.parametrize("stretch", [0.0, 3.0])
def test_blocks_that_are_passed_over_would_show_nothing(stretch: float) -> None:
    drawn, largest, _ = drawn_blocks(stretch, opacity_logit=-4.2)  # so faint that nothing saturates
    assert len(drawn) > 1000
    # Not drawn below the cut; within rounding of it, either is right.
    assert largest[~drawn].max() < DEFAULT_OPTIONS.min_alpha * (1 + 1e-5)


def test_few_blocks_are_drawn_in_vain() -> None:
    """Whole columns of blocks would be half as many again."""
    drawn, largest, _ = drawn_blocks(stretch=0.0, opacity_logit=-4.2)
    assert drawn.sum() < 1.01 * (largest >= DEFAULT_OPTIONS.min_alpha).sum()


def test_saturated_blocks_are_passed_over() -> None:
    """Behind many opaque splats nothing is drawn, although splats are there."""
    drawn, largest, tiles = drawn_blocks(stretch=1.5, opacity_logit=8.0)
    useful = largest >= DEFAULT_OPTIONS.min_alpha
    crowded = np.bincount(tiles) > 100
    assert crowded.any()
    assert drawn[crowded[tiles]].sum() < 0.9 * useful[crowded[tiles]].sum()
