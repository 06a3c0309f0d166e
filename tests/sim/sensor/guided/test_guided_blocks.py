"""Which disparities a pixel tries."""

import numpy as np
import pytest

from digs_warp.sim.sensor.guided.blocks import choose_blocks, coarse_blocks
from reference.guided_twin import twin_blocks
from reference.stereo_frames import broadband


def unpacked(blocks: np.ndarray) -> np.ndarray:
    return np.stack([(blocks >> (7 * slot)) & 127 for slot in range(4)], axis=-1)


@pytest.fixture(scope="module")
def scene() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two unrelated images, whose coarse search prefers anything, and a surface with steps everywhere."""
    rng = np.random.default_rng(4)
    surface = rng.uniform(0, 159, (8, 12)).repeat(9, 0).repeat(11, 1).astype(np.float32)
    left, right = rng.integers(0, 256, (2, *surface.shape), np.uint8)
    return surface, left, right


@pytest.mark.parametrize("count", [4, 5, 20, 128])
def test_the_blocks_follow_the_rules(
    scene: tuple[np.ndarray, np.ndarray, np.ndarray], count: int
) -> None:
    surface, left, right = scene
    found = unpacked(choose_blocks(surface, left, right, count, 5).numpy())
    coarse = coarse_blocks(left, right, count, 5)
    height, width = surface.shape
    for y in range(0, height, 5):
        for x in range(0, width, 3):
            around = surface[max(y - 4, 0) : y + 5, max(x - 4, 0) : x + 5]
            d = min(surface[y, x], x)  # what lies farther left has no partner
            other = -1
            if d - around.min() > 2:
                other = int(around.min() // 8)
            if around.max() - d > 2:
                other = int(around.max() // 8)
            far = coarse[min(y // 8, len(coarse) - 1), min(x // 8, coarse.shape[1] - 1)]
            own = min(int(d // 8), count - 1)
            side = 1 if d - 8 * own >= 4 else -1
            assert set(found[y, x]) == twin_blocks(own, side, other, int(far), count)


def test_blocks_are_sorted_and_their_bits_tell_neighbors(
    scene: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    surface, left, right = scene
    packed = choose_blocks(surface, left, right, 20, 5).numpy()
    found = unpacked(packed)
    assert (np.diff(found, axis=-1) > 0).all()
    bits = np.stack([(packed >> (28 + i)) & 1 for i in range(3)], axis=-1)
    np.testing.assert_array_equal(bits, np.diff(found, axis=-1) == 1)


def test_repeating_texture_adds_the_disparity_that_a_full_search_might_take() -> None:
    """Stripes with a period of 64 px: half the matches of a full search are off by one period."""
    rng = np.random.default_rng(0)
    stripes = np.tile(broadband((96, 64), 1)[..., 0], (1, 7)).astype(np.float64)
    left = stripes[:, :320] + rng.standard_normal((96, 320))
    right = stripes[:, 80:400] + rng.standard_normal((96, 320))  # 80 px: one period is 16 px
    left, right = (np.clip(image, 0, 255).astype(np.uint8) for image in (left, right))
    surface = np.full((96, 320), 80, np.float32)
    found = unpacked(choose_blocks(surface, left, right, 20, 5).numpy())
    tries_two = (found == 2).any(axis=-1)  # 16 px
    assert (found == 10).any(axis=-1).all()
    assert tries_two[:, 160:].mean() > 0.3
