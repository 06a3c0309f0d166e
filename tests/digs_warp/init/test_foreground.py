"""Two clusters of depth: exact splits, the weighted border, and masks that disagree with the depth."""

import numpy as np
import pytest

from digs_warp.init.foreground import EVERYTHING, foreground_range, two_means

OBJECT = (slice(10, 30), slice(15, 45))


def scene(
    object_depth: float = 0.9, background: float = 4.0, noise: float = 0.0, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """An object of some depth before a background of some depth, and its mask."""
    rng = np.random.default_rng(seed)
    depth = rng.uniform(background - 0.5, background + 0.5, (40, 60))
    mask = np.zeros((40, 60), dtype=bool)
    mask[OBJECT] = True
    depth[OBJECT] = rng.uniform(object_depth - 0.2, object_depth + 0.2, (20, 30))
    # Stereo noise grows with the square of the distance.
    return (depth + noise * depth**2 * rng.normal(size=depth.shape)).astype(np.float32), mask


def brute_force(values: np.ndarray) -> tuple[float, float]:
    """Means of the split with the smallest summed squared distances."""
    splits = [
        (
            np.sum((low - low.mean()) ** 2) + np.sum((high - high.mean()) ** 2),
            low.mean(),
            high.mean(),
        )
        for low, high in (np.split(values, [k]) for k in range(1, len(values)))
    ]
    _, low, high = min(splits)
    return float(low), float(high)


def kept_of(depth: np.ndarray, found: tuple[np.float32, np.float32]) -> np.ndarray:
    return (depth >= found[0]) & (depth <= found[1])


@pytest.mark.parametrize("seed", range(2))
def test_the_split_is_the_best_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    # Fewer than a hundred values: none is trimmed.
    values = np.sort(np.append(rng.normal(1.0, 0.2, 50), rng.normal(2.0, 0.4, 40)))
    assert two_means(values) == pytest.approx(brute_force(values), rel=1e-12)


def test_the_border_is_three_times_nearer_to_the_background_also_in_a_large_view() -> None:
    depth, mask = scene()
    near, far = two_means(np.sort(depth.ravel())) or (0.0, 0.0)
    border = near + 0.75 * (far - near)
    assert foreground_range(depth, mask)[1] == pytest.approx(border)
    below = np.repeat(np.arange(40) > 34, 60).reshape(40, 60)  # only the background
    large = (np.kron(layer, np.ones((20, 20), layer.dtype)) for layer in (depth, below))
    assert foreground_range(*large)[0] == pytest.approx(near + 0.25 * (far - near), rel=0.02)
    # An empty mask means the nearer cluster.
    assert foreground_range(depth, np.zeros_like(mask))[1] == pytest.approx(border)


@pytest.mark.parametrize("strength", [0, 4])
def test_a_leak_is_found_and_the_object_kept_whatever_the_noise(strength: int) -> None:
    depth, mask = scene(noise=0.002 * strength)  # a ZED 2: 0.0012 at strength 1
    leaking = mask.copy()
    leaking[25:, 40:] = True
    kept = kept_of(depth, foreground_range(depth, leaking)) & leaking
    np.testing.assert_array_equal(kept, mask)


def test_background_nearer_than_the_object_is_left_out() -> None:
    depth, mask = scene(object_depth=3.0, background=0.8)
    leaking = mask | (np.arange(60) > 50)
    kept = kept_of(depth, foreground_range(depth, leaking)) & leaking
    np.testing.assert_array_equal(kept, mask)


@pytest.mark.parametrize("mask_share", ["exact", "half"])
def test_an_object_without_measured_background_is_not_cut_in_two(mask_share: str) -> None:
    depth, mask = scene()
    depth[~mask] = np.nan
    depth[:, 30:] += np.float32(0.5)  # two parts, one behind the other
    if mask_share == "half":
        mask[:, 31:] = False
        mask[:, 38:45] = mask[:, 20:27]
    found = foreground_range(depth, mask)
    assert found == EVERYTHING
    assert np.count_nonzero(kept_of(depth, found)) == 600
