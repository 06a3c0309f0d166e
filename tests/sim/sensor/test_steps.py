"""Steps, the spatial filter of a device and noise fields, against their definitions."""

import numpy as np
import pytest
from scipy import stats

from digs_warp.sim.sensor.noise_field import octave_normal, white_normal
from digs_warp.sim.sensor.smoothing import DELTA, ITERATIONS, smooth_spatially
from digs_warp.sim.sensor.steps import near_steps


def rough(shape: tuple[int, int]) -> np.ndarray:
    """Disparity with steps of every size and pixels without a value, also at the rim."""
    rng = np.random.default_rng(shape[1])
    disparity = np.cumsum(rng.choice([0.0, 0.1, -0.3, 5.0, -4.0], shape), axis=1).astype(np.float32)
    disparity[rng.random(shape) < 0.1] = np.nan
    return disparity


def near_twin(disparity: np.ndarray, threshold: float, radius: int) -> np.ndarray:
    """Which pixels are that near to either side of a step along rows or columns."""
    near = np.zeros(disparity.shape, bool)
    for values, marks in ((disparity, near), (disparity.T, near.T)):
        for row, column in np.argwhere(np.abs(np.diff(values, axis=1)) > threshold):
            rows = slice(max(0, row - radius), row + radius + 1)
            marks[rows, max(0, column - radius) : column + radius + 2] = True
    return near


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 2), (3, 70), (20, 150)])
def test_steps_are_those_of_the_definition(shape: tuple[int, int]) -> None:
    disparity = rough(shape)
    for threshold, radius in ((1.0, 0), (4.5, 2)):
        found = near_steps(disparity, threshold, radius)
        np.testing.assert_array_equal(found, near_twin(disparity, threshold, radius))


def twin(disparity: np.ndarray, alpha: float) -> np.ndarray:
    """The exponential moving average as Intel describes it; it restarts at steps and after holes."""
    values = disparity.astype(np.float64)
    for _ in range(ITERATIONS):
        for line in (line for lines in (values, values.T) for line in lines):
            for way in (line, line[::-1]):
                for t in range(1, len(way)):
                    if abs(way[t] - way[t - 1]) < DELTA:
                        way[t] = alpha * way[t] + (1 - alpha) * way[t - 1]
    return values


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (7, 5), (24, 300)])
def test_the_spatial_filter_is_its_twin(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    disparity = 20 + 0.1 * np.arange(shape[1]) + rng.normal(0, 0.2, shape)
    disparity[:, shape[1] // 2 :] += 5
    disparity[rng.random(shape) < 0.2] = np.nan
    for alpha in (0.5, 1.0):
        found = smooth_spatially(disparity.astype(np.float32), alpha)
        np.testing.assert_allclose(found, twin(disparity, alpha), atol=2e-5)


def generator(seed: int) -> np.random.Generator:
    return np.random.Generator(np.random.SFC64(seed))


def test_white_noise_is_normal_and_independent() -> None:
    values = white_normal(generator(1), (400, 500, 3))
    assert values.dtype == np.float32 and values.shape == (400, 500, 3)
    assert values.mean() == pytest.approx(0, abs=0.005)
    assert values.std() == pytest.approx(1, abs=0.004)
    assert stats.kurtosis(values.ravel()) == pytest.approx(0, abs=0.03)
    # Kolmogorov-Smirnov: the largest distance from the normal distribution function.
    assert stats.kstest(values.ravel(), "norm").pvalue > 0.01
    for first, second in (
        (values[:-1], values[1:]),
        (values[:, :-1], values[:, 1:]),
        (values[..., :-1], values[..., 1:]),
    ):
        assert np.mean(first * second) == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize("correlation", [2.0, 6.0, 16.0])
def test_octaves_have_variance_one(correlation: float) -> None:
    fields = [octave_normal(generator(seed), (400, 600), correlation) for seed in range(4)]
    assert np.var(fields) == pytest.approx(1, abs=0.06)


def test_octaves_bear_tiny_images() -> None:
    assert octave_normal(generator(0), (1, 3), 16.0).shape == (1, 3)
