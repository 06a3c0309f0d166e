"""White noise from quantiles: its distribution, its independence, and that it repeats."""

import numpy as np
import pytest
from scipy import stats

from digs_warp.sim.sensor.noise_field import octave_normal, white_normal


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
