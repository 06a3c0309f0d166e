"""The loops over an image against the same operations in NumPy, to the bit."""

import numpy as np
import pytest

from digs_warp.sim.sensor.color.pixel_loops import looked_up, times_gain, with_noise
from digs_warp.sim.sensor.noise_field import drawn_quantiles, normal_quantiles
from reference import color_twin

FACTORS = (0.7, 1.0, 1.9)


def light(*shape: int) -> np.ndarray:
    """Light from below black to above white."""
    return np.random.default_rng(1).uniform(-0.2, 1.3, shape).astype(np.float32)


@pytest.mark.parametrize("is_shot", [False, True])
@pytest.mark.parametrize("width", [1, 37])
def test_noise_is_that_of_numpy(is_shot: bool, width: int) -> None:
    linear = light(11, width, 3)
    drawn = drawn_quantiles(np.random.default_rng(2), linear.size)
    normal = normal_quantiles()[drawn].reshape(linear.shape)
    expected = color_twin.with_noise(linear, FACTORS, normal, is_shot)
    np.testing.assert_array_equal(with_noise(linear, FACTORS, drawn, is_shot), expected)


@pytest.mark.parametrize("clipped", [0.995, np.inf])
def test_gain_is_that_of_numpy(clipped: float) -> None:
    linear = light(11, 37, 3)
    expected = color_twin.times_gain(linear, FACTORS, clipped)
    np.testing.assert_array_equal(times_gain(linear, FACTORS, clipped), expected)


@pytest.mark.parametrize("shape", [(11, 37, 3), (5, 4), (0, 3)])
def test_table_values_are_those_of_numpy(shape: tuple[int, ...]) -> None:
    table = np.random.default_rng(3).integers(0, 256, 65536).astype(np.uint8)
    linear = light(*shape)
    np.testing.assert_array_equal(looked_up(linear, table), color_twin.looked_up(linear, table))


def test_views_that_skip_pixels_are_read_in_their_order() -> None:
    table = np.arange(256, dtype=np.uint8)
    linear = light(12, 10, 3)[::2, ::-1]
    np.testing.assert_array_equal(looked_up(linear, table), color_twin.looked_up(linear, table))
    expected = color_twin.times_gain(linear, FACTORS, 0.9)
    np.testing.assert_array_equal(times_gain(linear, FACTORS, 0.9), expected)
