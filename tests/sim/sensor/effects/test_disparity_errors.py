"""Effects on matched depth, against the figures of the rig."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.sim.sensor.frame import Cause, FrameTruth, Sensed
from digs_warp.sim.sensor.tiers import apply_effects
from reference.stereo_frames import make_frame, make_rig


def error_of(truth: FrameTruth, *names: str, seed: int = 0, strength: float = 1.0) -> np.ndarray:
    """What the named effects add to the disparity [px]."""
    sensed = apply_effects(Sensed.of(truth), truth.rig, names, seed, truth.number, strength)
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


def test_quantum_rounds_to_the_nearest_step() -> None:
    rig = make_rig(disparity_step=1 / 32)
    truth = make_frame(np.linspace(5, 200, 320)[None, :], rig)
    error = error_of(truth, "quantum")
    sensed = error + truth.disparity
    np.testing.assert_array_equal(sensed * 32, np.rint(sensed * 32))
    assert 0.9 / 64 < np.abs(error).max() <= 1 / 64 + 1e-5


def test_static_field_belongs_to_the_unit_and_is_smooth() -> None:
    rig = make_rig(640, 480, static_field=0.1)
    first = error_of(make_frame(50.0, rig, number=0), "static-field", seed=1)
    later = error_of(make_frame(30.0, rig, number=9), "static-field", seed=2)
    np.testing.assert_allclose(first, later, atol=1e-5)  # float32 at 50 px
    assert first.std() == pytest.approx(0.1, rel=0.01)
    assert correlation_length(first, 1) == pytest.approx(640 / 16, rel=0.3)
    other = error_of(make_frame(50.0, replace(rig, unit=1)), "static-field")
    assert abs(np.corrcoef(first.ravel(), other.ravel())[0, 1]) < 0.3


def test_a_relative_error_is_part_of_the_field_and_falls_with_the_disparity() -> None:
    rig = make_rig(640, 480, static_field=0.05, disparity_distortion=0.002)
    far, near = (error_of(make_frame(d, rig), "static-field").std() for d in (10.0, 50.0))
    assert (far, near) == (pytest.approx(0.07, rel=0.02), pytest.approx(0.15, rel=0.02))


def test_the_device_smooths_noise_but_no_steps() -> None:
    rig = make_rig(smoothing=0.4)
    true = np.full((240, 320), 30.0, np.float32)
    true[:, 160:] = 33.0
    noise = 0.1 * np.random.default_rng(0).standard_normal(true.shape).astype(np.float32)
    truth = make_frame(true, rig)
    matched = replace(Sensed.of(truth), disparity=true + noise)
    after = apply_effects(matched, rig, ["smoothing"]).disparity - true
    assert after.std() < 0.5 * noise.std()
    assert np.abs(after[:, 150:170]).max() < 0.4, "a step of 3 px stays"
    same = apply_effects(matched, replace(rig, smoothing=0.0), ["smoothing"])
    np.testing.assert_array_equal(same.disparity, matched.disparity)


def test_the_device_drops_what_it_does_not_trust() -> None:
    rig = make_rig(least_confidence=0.6)
    plain = Sensed.of(make_frame(30.0, rig))
    trust = np.linspace(0, 1, plain.confidence.size, dtype=np.float32)
    trust = trust.reshape(plain.confidence.shape)
    after = apply_effects(replace(plain, confidence=trust), rig, ["rejection"])
    np.testing.assert_array_equal(after.known, trust >= np.float32(0.6))
    assert (after.cause[~after.known] == Cause.LOW_CONFIDENCE).all()


def test_speckle_is_what_changes_of_the_noise() -> None:
    rig = make_rig(disparity_sigma=0.2, temporal_share=0.25, disparity_correlation=4.0)
    assert (error_of(make_frame(30.0, rig), "speckle") == 0).all(), "no projector"
    rig = replace(rig, projector_power=0.2)
    first, second = (error_of(make_frame(30.0, rig, number=number), "speckle") for number in (0, 1))
    assert first.std() == pytest.approx(0.1, rel=0.05)
    assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.05
    assert np.corrcoef(first[:, 1:].ravel(), first[:, :-1].ravel())[0, 1] > 0.5, (
        "neighbors err alike"
    )
