"""Figures of depth cameras on depth that is known in closed form."""

import numpy as np
import pytest

from digs_warp.sim.fit.device_figures import (
    WINDOWS,
    correlation_of,
    holes,
    roughness,
    temporal_share,
)
from digs_warp.sim.sensor.noise_field import octave_normal

SHAPE = (240, 320)


def generator(seed: int = 0) -> np.random.Generator:
    return np.random.Generator(np.random.SFC64(seed))


def slope() -> np.ndarray:
    rows, columns = np.indices(SHAPE)
    return 20 + 0.02 * columns - 0.01 * rows


def test_roughness_is_that_of_planes_without_holes_or_steps() -> None:
    disparity = slope() + 0.05 * generator().standard_normal(SHAPE)
    disparity[:, 150:] += 10.0
    disparity[100, 100] = np.nan
    found = roughness(disparity, 32)
    assert len(found.residual) == 7 * 9 - 1
    assert found.median() == pytest.approx(0.05, rel=0.02)
    assert found.estimate.error < 0.002
    assert roughness(disparity, 24).median(0, 26) == pytest.approx(0.05, rel=0.02)
    assert np.isnan(found.median(100, 200))


@pytest.mark.parametrize("correlation", [0.0, 3.0, 12.0, 30.0])
def test_the_growth_of_roughness_tells_the_correlation(correlation: float) -> None:
    field = 0.1 * octave_normal(generator(), (960, 1280), correlation)
    found = correlation_of([roughness(field, size).median() for size in WINDOWS])
    assert found == pytest.approx(correlation, rel=0.3)


def test_two_windows_tell_no_correlation() -> None:
    assert np.isnan(correlation_of([0.02, 0.03, np.nan, np.nan]))


def test_what_changes_and_what_stays_are_told_apart() -> None:
    rng = generator()
    stack = 0.3 * rng.standard_normal(SHAPE) + 0.1 * rng.standard_normal((8, *SHAPE))
    stack[2, 5, 5] = np.nan
    assert temporal_share(stack) == pytest.approx(0.1, rel=0.05)


def test_holes_are_counted_with_their_corners() -> None:
    disparity = np.ones((100, 100))
    disparity[10, 10] = disparity[11, 11] = np.nan  # one hole of two pixels
    disparity[40:44, 40:44] = np.nan
    found = holes(disparity)
    assert (found.share, found.per_10000) == (18 / 10_000, 2)
    assert found.small == pytest.approx(2 / 18)
