"""A gain on linear light is found from sRGB colors, whatever else the photograph shows."""

import numpy as np
import pytest

from digs_warp.data.images import linear_from_srgb, srgb_from_linear
from digs_warp.measure.color_gain import MOST_STOPS, fit_color_gain

STOPS = np.array([0.7, -0.4, 0.1])


def colors(count: int = 400) -> np.ndarray:
    return np.random.default_rng(0).uniform(0.1, 0.6, (count, 3))


def photographed(scene: np.ndarray, stops: np.ndarray = STOPS) -> np.ndarray:
    """Return what a camera with this gain records, 8 bits, clipped."""
    light = linear_from_srgb(scene) * 2.0**stops
    return np.rint(255 * np.clip(srgb_from_linear(light), 0, 1)) / 255


def test_clipped_and_black_pixels_tell_nothing() -> None:
    bright = np.array([2.0, 2.0, 2.0])
    photo = photographed(colors(), bright)
    assert (photo == 1).mean() > 0.1
    photo[::7] = 0
    np.testing.assert_allclose(fit_color_gain(colors(), photo).stops, bright, atol=0.02)


@pytest.mark.parametrize("photo", [np.ones((400, 3)), np.zeros((0, 3))])
def test_without_a_usable_pixel_there_is_no_gain(photo: np.ndarray) -> None:
    scene = colors()[: len(photo)]
    np.testing.assert_array_equal(fit_color_gain(scene, photo).stops, 0)
    before = np.array([0.1, 0.2, 0.3])
    np.testing.assert_array_equal(fit_color_gain(scene, photo, before).log_factors, before)


@pytest.mark.parametrize("value", [np.nan, -1.0])
def test_any_rendering_gives_a_finite_gain_within_limits(value: float) -> None:
    scene = colors()
    scene[:, 1] = value
    stops = fit_color_gain(scene, photographed(colors())).stops
    assert np.all(np.abs(stops) <= MOST_STOPS + 1e-9)


@pytest.mark.parametrize("count", [17, 400])
def test_the_gain_is_that_of_huber_weights_around_the_median(count: int) -> None:
    """Bit for bit: the medians are NumPy's, for odd and even numbers of pixels."""
    scene, photo = colors(count), photographed(colors(count))
    photo[::5] *= 0.7
    for channel in range(3):
        x, y = scene[:, channel] + 0.055, photo[:, channel] + 0.055
        factor = np.median(y / x)
        for _ in range(4):
            residuals = np.abs(y - factor * x)
            allowed = 1.345 * max(1.4826 * np.median(residuals), 1 / (255 * 12**0.5))
            weighted = allowed / np.maximum(residuals, allowed) * x
            factor = (weighted * y).sum() / (weighted * x).sum()
        assert fit_color_gain(scene, photo).log_factors[channel] == np.log(factor)
