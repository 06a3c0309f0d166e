"""A lift beside the gains is found from sRGB colors, and none where nothing tells it."""

import numpy as np
import pytest

from digs_warp.measure.color_gain import OFFSET, ColorGain, fit_color_gain
from digs_warp.measure.color_lift import MOST_LIFT, fit_lift, trusted_lift, trusted_share

GAIN = ColorGain(np.array([0.1, -0.15, 0.05]), lift=0.07)


def colors(count: int = 400) -> np.ndarray:
    return np.random.default_rng(0).uniform(0.1, 0.6, (count, 3))


def photographed(scene: np.ndarray, gain: ColorGain = GAIN) -> np.ndarray:
    """Return what a camera of this gain and lift records, 8 bits, clipped."""
    return np.rint(255 * np.clip(gain.applied(scene), 0, 1)) / 255


@pytest.mark.parametrize("lift", [0.07, -0.05, 0.0])
def test_lift_and_gains_are_found(lift: float) -> None:
    photo = photographed(colors(), ColorGain(GAIN.log_factors, lift))
    found = fit_lift(colors(), photo)
    assert found == pytest.approx(lift, abs=0.002)
    gain = fit_color_gain(colors(), photo, lift=found)
    np.testing.assert_allclose(gain.applied(colors()), photo, atol=0.004)


def test_a_gain_of_light_has_hardly_a_lift_and_none_that_is_trusted() -> None:
    for log_factor in (-0.3, 0.2):
        photo = photographed(colors(), ColorGain(np.full(3, log_factor)))
        assert trusted_lift(colors(), photo) == 0
        found = fit_color_gain(colors(), photo, lift=trusted_lift(colors(), photo))
        np.testing.assert_array_equal(
            found.log_factors, fit_color_gain(colors(), photo).log_factors
        )


def test_outliers_and_clipped_values_do_not_pull() -> None:
    photo = photographed(colors(), ColorGain(np.full(3, 0.5), lift=0.07))
    assert (photo == 1).any()
    photo[::7] = np.random.default_rng(1).uniform(0.05, 0.9, photo[::7].shape)
    assert fit_lift(colors(), photo) == pytest.approx(0.07, abs=0.02)


@pytest.mark.parametrize("photo", [np.zeros((400, 3)), np.ones((400, 3)), np.zeros((0, 3))])
def test_without_a_usable_pixel_there_is_no_lift(photo: np.ndarray) -> None:
    assert fit_lift(colors()[: len(photo)], photo) == 0


@pytest.mark.parametrize("value", [np.nan, -1.0, 0.041, 50.0, 1e30])
def test_any_rendering_gives_a_finite_lift_within_limits(value: float) -> None:
    scene = colors()
    scene[:, 1] = value
    assert abs(fit_lift(scene, photographed(colors()))) <= MOST_LIFT


def test_constant_images_tell_no_lift() -> None:
    assert fit_lift(np.full((50, 3), 0.5), np.full((50, 3), 0.4)) == 0
    assert fit_lift(np.full((50, 3), 0.5), photographed(colors(50))) == 0


def test_the_lift_is_that_of_weighted_least_squares() -> None:
    """As the normal equations of all four unknowns give it, with the same Huber weights."""
    scene, photo = colors(), photographed(colors())
    photo[::5] *= 0.7
    x, y = scene + OFFSET, photo + OFFSET
    weights = np.ones_like(x)
    for _ in range(4):
        columns = np.zeros((*x.shape, 4))
        columns[..., 3] = 1.0
        for channel in range(3):
            columns[:, channel, channel] = x[:, channel]
        root = np.sqrt(weights)
        rows = (root[..., None] * columns).reshape(-1, 4)
        solved = np.linalg.lstsq(rows, (root * y).reshape(-1), rcond=None)[0]
        residuals = np.abs(y - columns @ solved)
        allowed = 1.345 * max(1.4826 * np.median(residuals), 1 / (255 * 12**0.5))
        weights = allowed / np.maximum(residuals, allowed)
    assert fit_lift(scene, photo) == pytest.approx(solved[3], abs=1e-9)


def test_small_lifts_are_not_trusted() -> None:
    assert trusted_share(0.0, 0.01**2) == trusted_share(0.01**2, 0.01**2) == 0
    assert trusted_share(0.1**2, 0.01**2) > 0.98
    assert trusted_share(0.1**2, 0.2**2) == 0
