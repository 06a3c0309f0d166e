"""The band-limited search: the disparities that it tries, and what it finds, against twins and OpenCV."""

import numpy as np
import pytest
import warp as wp

from digs_warp.checks import DigsError
from digs_warp.device import parallel
from digs_warp.sim.sensor.guided.blocks import choose_blocks
from digs_warp.sim.sensor.guided.planes import make_planes
from digs_warp.sim.sensor.guided.search import (
    STRIP_ROWS,
    WARM_UP,
    coarse_half_blocks,
    search,
    search_blocks,
)
from reference.guided_twin import (
    tried_disparities,
    twin_blocks,
    twin_costs,
    twin_hidden,
    twin_matches,
    twin_sums,
    unpacked,
)
from reference.stereo_frames import broadband


def stepped_pair(
    shape: tuple[int, int], seed: int = 0, noise: float = 2.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two noisy images of a texture on a slope with a near box, and a surface that is about theirs."""
    height, width = shape
    rng = np.random.default_rng(seed)
    texture = broadband((height, width + 128), seed)[..., 0].astype(np.float64)
    surface = np.tile(np.linspace(6, 14, width), (height, 1))
    surface[height // 4 : 3 * height // 4, width // 3 : 2 * width // 3] = 33.3
    rows, columns = np.indices(shape)
    moved = texture[rows, (columns + surface).astype(int)]
    noisy = [image + noise * rng.standard_normal(shape) for image in (texture[:, :width], moved)]
    left, right = (np.clip(np.rint(image), 0, 255).astype(np.uint8) for image in noisy)
    return left, right, surface.astype(np.float32)


def wide_blocks(
    left: np.ndarray, right: np.ndarray, surface: np.ndarray, count: int, window: int = 5
) -> np.ndarray:
    """Four blocks for every pixel."""
    coarse = coarse_half_blocks(left, right, count, window)
    return choose_blocks(surface, coarse, count).numpy()


def searched(
    left: np.ndarray,
    right: np.ndarray,
    blocks: np.ndarray,
    disparities: int,
    window: int = 5,
    uniqueness: int = 13,
    smoothness: float = 1.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    eyes = make_planes(left, right, disparities)
    packed = wp.array(blocks, dtype=int, device="cpu")
    return search_blocks(eyes, packed, window, uniqueness, smoothness)


@pytest.mark.parametrize(("window", "smoothness"), [(1, 1.0), (3, 0.375), (5, 1.0), (7, 1.0)])
def test_disparity_and_costs_equal_the_twin_to_the_bit(window: int, smoothness: float) -> None:
    left, right, surface = stepped_pair((35, 75), seed=window)
    blocks = wide_blocks(left, right, surface, 10, window)
    found = searched(left, right, blocks, 80, window, smoothness=smoothness)
    costs = twin_costs(left, right, 80, window)
    steps = (round(8 * smoothness * window**2), round(32 * smoothness * window**2))
    sums = twin_sums(costs, tried_disparities(blocks, 80), *steps)
    for mine, twins in zip(found, twin_matches(sums, 13, 1), strict=True):
        np.testing.assert_array_equal(mine, twins)
    assert 0.3 < (found[0] >= 0).mean() < 1, "or the checks were not tested"


def test_with_the_full_range_in_the_band_it_is_opencvs_search() -> None:
    import cv2

    left, right, _ = stepped_pair((120, 200))
    surface = np.full(left.shape, 12.0, np.float32)  # 32 disparities: all are tried
    blocks = wide_blocks(left, right, surface, 4)
    found, _, _ = searched(left, right, blocks, 32, uniqueness=10)
    matcher = cv2.StereoSGBM.create(0, 32, 5, 200, 800, 1, 0, 10, 0, 0)
    pair = [cv2.copyMakeBorder(i, 0, 0, 32, 0, cv2.BORDER_CONSTANT) for i in (left, right)]
    full = matcher.compute(pair[0], pair[1])[:, 32:]
    mine = cv2.medianBlur(found, 3)  # OpenCV's search ends with this median
    inside = (slice(8, -8), slice(8, -16))  # OpenCV treats the right border in another way
    assert (np.maximum(full, -16) == mine)[inside].mean() > 0.99
    assert (full[inside] >= 0).mean() > 0.4


def test_strips_hardly_differ_from_one_search_and_not_with_the_threads(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    left, right, surface = stepped_pair((2 * STRIP_ROWS, 120))
    blocks = wide_blocks(left, right, surface, 10)
    both = searched(left, right, blocks, 80)[0]
    monkeypatch.setattr(parallel, "default_threads", lambda: 1)
    np.testing.assert_array_equal(both, searched(left, right, blocks, 80)[0])
    # The lower half alone, with the rows above in which its paths warm up.
    lower = slice(STRIP_ROWS - WARM_UP - 2, None)
    alone = searched(left[lower], right[lower], blocks[lower], 80)[0]
    same = alone[WARM_UP + 4 :] == both[STRIP_ROWS + 2 :]
    assert same[: STRIP_ROWS // 2].mean() > 0.97


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (7, 9), (17, 59), (16, 58), (33, 117)])
def test_images_of_any_size(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    left, right = rng.integers(0, 256, (2, *shape), np.uint8)
    found = search(left, right, np.full(shape, 5, np.float32), 32)
    assert found.disparity.shape == shape
    assert np.isfinite(found.cost).all() and np.isfinite(found.rival).all()


def test_ranges_and_windows_that_cannot_be_searched_are_named() -> None:
    gray = np.zeros((10, 10), np.uint8)
    surface = np.zeros((10, 10), np.float32)
    with pytest.raises(
        DigsError, match="disparities: 24, expected a multiple of 8 from 32 to 1024"
    ):
        search(gray, gray, surface, 24)
    with pytest.raises(DigsError, match="window: 9, expected 1, 3, 5 or 7"):
        search(gray, gray, surface, 32, window=9)
    with pytest.raises(DigsError, match="right image"):
        search(gray, gray[:5], surface, 32)


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
