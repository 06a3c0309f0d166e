"""Effects that shift disparity, against the figures of the rig and the closed form of stereo."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.effects.correlated_noise import temporal_noise, texture_pattern
from digs_warp.sim.sensor.effects.static_field import unit_field
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.tiers import depth_of, sense_effects
from reference.stereo_frames import broadband, make_frame, make_rig

ERRORS = ("ripple", "correlated-noise", "static-field", "quantum")


def error_of(truth: FrameTruth, *names: str, seed: int = 0, strength: float = 1.0) -> np.ndarray:
    """What the named effects add to the disparity [px]."""
    sensed = sense_effects(truth, names, seed, strength)
    assert (sensed.cause == Cause.OK).all(), "noise does not label pixels"
    return sensed.disparity.astype(np.float64) - truth.disparity


def correlation_length(field: np.ndarray, axis: int) -> float:
    """Distance at which the autocorrelation along an axis falls to 1/e [px], interpolated."""
    field = np.moveaxis(field - field.mean(), axis, 1)
    variance = np.mean(field**2)
    lags = np.arange(1, 90)
    correlation = np.array([1.0, *(np.mean(field[:, k:] * field[:, :-k]) / variance for k in lags)])
    below = int(np.argmax(correlation < 1 / np.e))
    high, low = correlation[below - 1], correlation[below]
    return below - 1 + (high - 1 / np.e) / (high - low)


def test_depth_noise_grows_with_the_square_of_depth() -> None:
    rig = make_rig(disparity_sigma=0.1, ripple=0.05, static_field=0.05, disparity_step=1 / 16)
    depths = np.array([0.6, 1.0, 1.7, 2.9, 5.0])
    sigmas = []
    for number, depth in enumerate(depths):
        # Tilted a little, so that the fraction of the disparity takes all values.
        disparity = rig.focal_baseline / depth + np.linspace(-1, 1, 320)[None, :]
        truth = make_frame(disparity, rig, number=number)
        error = depth_of(sense_effects(truth, ERRORS), truth) - truth.depth
        sigmas.append(np.std(error * (depth / truth.depth) ** 2))
    slope = np.polyfit(np.log(depths), np.log(sigmas), 1)[0]
    assert slope == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("sigma", [0.05, 0.15])
def test_subpixel_rms_is_the_rigs(share: float, sigma: float) -> None:
    rig = make_rig(640, 480, disparity_sigma=sigma, temporal_share=share)
    error = error_of(make_frame(50.0, rig), "correlated-noise")
    assert np.sqrt(np.mean(error**2)) == pytest.approx(sigma, rel=0.05)


def test_parts_of_the_error_add_up_as_independent_ones() -> None:
    rig = make_rig(
        640, 480, disparity_sigma=0.1, ripple=0.07, static_field=0.1, disparity_step=1 / 8
    )
    truth = make_frame(np.linspace(40, 60, 640)[None, :], rig)
    expected = np.sqrt(0.1**2 + 0.07**2 / 2 + 0.1**2 + (1 / 8) ** 2 / 12)
    assert error_of(truth, *ERRORS).std() == pytest.approx(expected, rel=0.05)


def test_temporal_noise_is_normal() -> None:
    rig = make_rig(640, 480, disparity_sigma=0.2, temporal_share=1.0)
    apart = error_of(make_frame(50.0, rig), "correlated-noise")[::12, ::12]  # beyond correlation
    assert kstest(apart.ravel() / 0.2, "norm").pvalue > 0.01


def test_what_remains_after_the_ripple_is_normal() -> None:
    rig = make_rig(640, 480, disparity_sigma=0.1, temporal_share=1.0, ripple=0.07)
    disparity = np.linspace(40, 60, 640)[None, :]
    error = error_of(make_frame(disparity, rig), "correlated-noise", "ripple")
    rest = (error + 0.07 * np.sin(2 * np.pi * disparity))[::12, ::12]
    assert kstest(rest.ravel() / 0.1, "norm").pvalue > 0.01
    assert kstest(error[::12, ::12].ravel() / 0.1, "norm").pvalue < 0.01


@pytest.mark.parametrize("length", [3.0, 4.0, 6.0, 9.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_temporal_noise_has_the_correlation_length_of_the_rig(length: float, axis: int) -> None:
    rig = make_rig(640, 480, disparity_sigma=0.1, temporal_share=1.0, noise_correlation=length)
    error = error_of(make_frame(50.0, rig), "correlated-noise")
    assert correlation_length(error, axis) == pytest.approx(length, abs=0.5)


def test_fixed_noise_is_about_as_smooth_as_temporal_noise() -> None:
    rig = make_rig(640, 480, disparity_sigma=0.1, temporal_share=0.0)
    error = error_of(make_frame(50.0, rig), "correlated-noise")
    assert correlation_length(error, 1) == pytest.approx(rig.noise_correlation, abs=1.0)


def test_noise_splits_into_a_fixed_and_a_temporal_part() -> None:
    rig = make_rig(disparity_sigma=0.1, temporal_share=0.4)
    errors = np.stack(
        [error_of(make_frame(50.0, rig, number=n), "correlated-noise") for n in range(24)]
    )
    temporal = errors.var(axis=0, ddof=1).mean()
    fixed = errors.mean(axis=0).var() - temporal / 24
    assert temporal == pytest.approx(0.4 * 0.1**2, rel=0.05)
    assert fixed == pytest.approx(0.6 * 0.1**2, rel=0.1)


@pytest.mark.parametrize("length", [3.0, 4.0, 9.0])
def test_noise_is_the_same_on_and_between_the_pixels_of_its_grid(length: float) -> None:
    shape = (481, 639)  # no whole number of cells
    temporal = temporal_noise(np.random.default_rng(0), shape, length)
    fixed = texture_pattern(broadband(shape)[..., 0], length)
    for field in (temporal, fixed):
        parts = [field[y::2, x::2].std() for y in (0, 1) for x in (0, 1)]
        np.testing.assert_allclose(parts, 1, atol=0.035)


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (2, 2), (5, 3)])
@pytest.mark.parametrize("length", [3.0, 4.0])
def test_noise_of_tiny_images_has_their_shape(shape: tuple[int, int], length: float) -> None:
    temporal = temporal_noise(np.random.default_rng(0), shape, length)
    fixed = texture_pattern(np.zeros(shape, np.uint8), length)
    assert temporal.shape == fixed.shape == shape
    assert np.isfinite(temporal).all() and (fixed == 0).all()


def test_fixed_noise_moves_with_the_texture() -> None:
    rig = make_rig(disparity_sigma=0.1, temporal_share=0.0)
    image = broadband((240, 320))
    here = error_of(make_frame(50.0, rig, image), "correlated-noise")
    there = error_of(make_frame(50.0, rig, np.roll(image, 7, axis=1)), "correlated-noise")
    inner = slice(60, -60)
    np.testing.assert_allclose(there[inner, inner], np.roll(here, 7, 1)[inner, inner], atol=6e-3)
    assert abs(np.corrcoef(there[inner, inner].ravel(), here[inner, inner].ravel())[0, 1]) < 0.4


def test_ripple_has_a_period_of_one_pixel_and_pulls_toward_whole_pixels() -> None:
    rig = make_rig(ripple=0.07)
    fraction = np.linspace(0, 1, 320, endpoint=False)
    periods = [error_of(make_frame(n + fraction[None], rig), "ripple") for n in (3, 40, 180)]
    for error in periods:
        np.testing.assert_allclose(error[0], -0.07 * np.sin(2 * np.pi * fraction), atol=1e-4)


def test_quantum_rounds_to_the_nearest_step() -> None:
    rig = make_rig(disparity_step=1 / 32)
    truth = make_frame(np.linspace(5, 200, 320)[None, :], rig)
    sensed = sense_effects(truth, ["quantum"]).disparity.astype(np.float64)
    np.testing.assert_array_equal(sensed * 32, np.rint(sensed * 32))
    error = np.abs(sensed - truth.disparity)
    assert 0.9 / 64 < error.max() <= 1 / 64 + 1e-5


def test_static_field_belongs_to_the_unit_and_is_smooth() -> None:
    rig = make_rig(640, 480, static_field=0.1)
    first = error_of(make_frame(50.0, rig, number=0), "static-field", seed=1)
    later = error_of(make_frame(30.0, rig, number=9), "static-field", seed=2)
    np.testing.assert_allclose(first, later, atol=1e-5)  # float32 at 50 px
    assert first.std() == pytest.approx(0.1, rel=0.01)
    assert correlation_length(first, 1) == pytest.approx(640 / 16, rel=0.3)
    other = error_of(make_frame(50.0, replace(rig, unit=1)), "static-field")
    assert abs(np.corrcoef(first.ravel(), other.ravel())[0, 1]) < 0.3


def test_static_field_exists_at_every_size() -> None:
    for width, height in [(1, 1), (1, 40), (40, 1), (17, 9)]:
        assert unit_field(0, width, height).shape == (height, width)
        assert np.isfinite(unit_field(0, width, height)).all()


@pytest.mark.parametrize("name", ["correlated-noise", "ripple", "static-field"])
def test_strength_scales_the_error(name: str) -> None:
    rig = make_rig(disparity_sigma=0.1, ripple=0.07, static_field=0.1)
    truth = make_frame(50.3, rig)
    once, twice = (error_of(truth, name, strength=s) for s in (1.0, 2.0))
    np.testing.assert_allclose(twice, 2 * once, atol=2e-5)  # float32 at 50 px


def test_far_depth_is_biased_as_the_inverse_of_a_noisy_disparity() -> None:
    """E[dZ] = Z^3 sigma^2 / (f b)^2, to second order."""
    rig = make_rig(640, 480, disparity_sigma=0.25, temporal_share=1.0, max_depth=100.0)
    depth = 12.0
    biases = []
    for number in range(20):
        truth = make_frame(rig.focal_baseline / depth, rig, number=number)
        sensed = sense_effects(truth, ["correlated-noise"])
        biases.append(np.mean(depth_of(sensed, truth).astype(np.float64)) - depth)
    expected = depth**3 * 0.25**2 / rig.focal_baseline**2
    assert np.mean(biases) == pytest.approx(expected, abs=4 * np.std(biases) / np.sqrt(20))
    assert np.mean(biases) > 0.5 * expected
