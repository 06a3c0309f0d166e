"""Which disparities a pixel tries."""

import numpy as np
import pytest

from digs_warp.sim.sensor.guided.blocks import choose_blocks
from digs_warp.sim.sensor.guided.search import coarse_half_blocks
from reference.guided_twin import twin_blocks, twin_hidden, unpacked
from reference.stereo_frames import broadband

Scene = tuple[np.ndarray, np.ndarray]


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A surface with steps everywhere, and squares whose coarse search prefers anything."""
    rng = np.random.default_rng(4)
    surface = rng.uniform(0, 159, (8, 12)).repeat(9, 0).repeat(11, 1).astype(np.float32)
    surface[:40] = np.linspace(0, 60, surface.shape[1], dtype=np.float32)  # a slope without steps
    coarse = (surface[::8, ::8] // 4).astype(np.int32)
    wrong = rng.random(coarse.shape) < 0.5
    coarse[wrong] = rng.integers(-1, 40, wrong.sum())
    return surface, coarse


@pytest.mark.parametrize("count", [4, 5, 20, 128])
@pytest.mark.parametrize("has_second", [False, True])
def test_the_blocks_follow_the_rules(scene: Scene, count: int, has_second: bool) -> None:
    surface, coarse = np.minimum(scene[0], 8 * count), np.minimum(scene[1], 2 * count - 1)
    rng = np.random.default_rng(1)
    second = rng.uniform(-20, 9 * count, surface.shape).astype(np.float32)
    second[rng.random(surface.shape) < 0.5] = np.nan
    blocks = choose_blocks(surface, coarse, count, second if has_second else None).numpy()
    height, width = surface.shape
    hidden = twin_hidden(surface)
    assert 0.05 < hidden.mean() < 0.95
    for y in range(0, height, 3):
        for x in range(0, width, 3):
            around = surface[max(y - 4, 0) : y + 5, max(x - 4, 0) : x + 5]
            d = min(float(surface[y, x]), x)  # what lies farther left has no partner
            far = int(coarse[min(y // 8, len(coarse) - 1), min(x // 8, coarse.shape[1] - 1)])
            other = min(float(second[y, x]), x) if 0 <= second[y, x] < 8 * count else np.nan
            behind = other if has_second else np.nan
            wanted = twin_blocks(d, around, far, count, behind, bool(hidden[y, x]))
            assert set(unpacked(int(blocks[y, x]))) == wanted


def test_blocks_are_sorted_and_their_bits_tell_neighbors(scene: Scene) -> None:
    surface, coarse = scene
    blocks = choose_blocks(surface, coarse, 20).numpy()
    for bits in np.unique(blocks).tolist():
        steps = np.diff(unpacked(bits))
        assert (steps > 0).all()
        assert [(bits >> (28 + i)) & 1 for i in range(len(steps))] == (steps == 1).tolist()


def test_repeating_texture_adds_the_disparity_that_a_full_search_might_take() -> None:
    """Stripes with a period of 64 px: half the matches of a full search are off by one period."""
    rng = np.random.default_rng(0)
    stripes = np.tile(broadband((96, 64), 1)[..., 0], (1, 7)).astype(np.float64)
    left = stripes[:, :320] + rng.standard_normal((96, 320))
    right = stripes[:, 80:400] + rng.standard_normal((96, 320))  # 80 px: one period is 16 px
    left, right = (np.clip(image, 0, 255).astype(np.uint8) for image in (left, right))
    surface = np.full((96, 320), 80, np.float32)
    coarse = coarse_half_blocks(left, right, 20, 5)
    blocks = choose_blocks(surface, coarse, 20).numpy()
    found = [set(unpacked(int(bits))) for bits in blocks[:, 160:].ravel()]
    assert all(10 in tried for tried in found)
    assert np.mean([2 in tried for tried in found]) > 0.3  # 16 px
