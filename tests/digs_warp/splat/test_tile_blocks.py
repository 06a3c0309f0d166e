"""A splat is in the list of every tile that it touches, and drawn in every block of it, and in few others."""

import numpy as np
import pytest

from digs_warp.splat.config import BLOCK_HEIGHT, BLOCK_WIDTH, MIN_ALPHA, TILE_SIZE
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
    members = np.array(lists.pairs.numpy(), dtype=int)[:pairs, 0]
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
    assert largest[~drawn].max() < MIN_ALPHA * (1 + 1e-5)


def test_few_blocks_are_drawn_in_vain() -> None:
    """Whole columns of blocks would be half as many again."""
    drawn, largest, _ = drawn_blocks(stretch=0.0, opacity_logit=-4.2)
    assert drawn.sum() < 1.01 * (largest >= MIN_ALPHA).sum()


def test_saturated_blocks_are_passed_over() -> None:
    """Behind many opaque splats nothing is drawn, although splats are there."""
    drawn, largest, tiles = drawn_blocks(stretch=1.5, opacity_logit=8.0)
    useful = largest >= MIN_ALPHA
    crowded = np.bincount(tiles) > 100
    assert crowded.any()
    assert drawn[crowded[tiles]].sum() < 0.9 * useful[crowded[tiles]].sum()


def test_lists_have_every_splat_that_touches_the_tile_nearest_first() -> None:
    twice = random_gaussians(150, seed=3).select(np.repeat(np.arange(150), 2))  # of equal depth
    renderer = SplatRenderer(DeviceGaussians.from_numpy(twice), *SIZE)
    renderer.forward(camera(*SIZE, fx=170.0, fy=170.0), near=NEAR)
    binner, lists = renderer.binner, renderer.binner.lists
    u, v, a, b, c, opacity = lists.splats.numpy().astype(np.float64).T[:6, :, None, None]
    y, x = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    power = 0.5 * (a * (x - u) ** 2 + c * (y - v) ** 2) + b * (x - u) * (y - v)
    seen = (opacity * np.exp(-power) > 1.001 * MIN_ALPHA) & (lists.centers.numpy() > 0)[
        :, None, None
    ]
    touched = seen.reshape(len(twice), binner.rows, 16, binner.columns, 16).any(axis=(2, 4))
    starts = np.array(lists.tile_starts.numpy(), dtype=int)
    pairs = np.array(lists.pairs.numpy(), dtype=int)[: binner.total_pairs]
    for tile in range(binner.tiles):
        members = pairs[starts[tile] : starts[tile + 1], 0]
        assert set(np.flatnonzero(touched.reshape(len(twice), -1)[:, tile])) <= set(members)
        order = np.lexsort([members, lists.centers.numpy()[members]])
        np.testing.assert_array_equal(order, np.arange(len(members)))
    assert touched.sum() > 0.7 * len(pairs)
    # Gradients are recorded splat by splat.
    by_number = pairs[np.argsort(pairs[:, 1]), 0]
    counts = np.diff(np.array(lists.pair_starts.numpy(), dtype=int))
    np.testing.assert_array_equal(by_number, np.repeat(np.arange(len(twice)), counts))
