"""Effects on depth: on what was matched, and on recorded frames, against the law of stereo and the rig."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.sim.sensor.effects.disparity_errors import unit_field
from digs_warp.sim.sensor.frame import Cause, FrameTruth, Sensed
from digs_warp.sim.sensor.on_recordings import (
    DISPARITY_NOISE,
    EFFECTS_ON_RECORDINGS,
    STEP_HOLES,
    worse_depth,
    worse_images,
)
from digs_warp.sim.sensor.tiers import apply_effects
from reference.stereo_frames import flat, make_frame, make_rig


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


def test_static_field_belongs_to_the_unit_and_is_smooth() -> None:
    rig = make_rig(640, 480, static_field=0.1)
    first = error_of(make_frame(50.0, rig, number=0), "static-field", seed=1)
    later = error_of(make_frame(30.0, rig, number=9), "static-field", seed=2)
    np.testing.assert_allclose(first, later, atol=1e-5)  # float32 at 50 px
    assert first.std() == pytest.approx(0.1, rel=0.01)
    assert correlation_length(first, 1) == pytest.approx(640 / 16, rel=0.3)
    other = error_of(make_frame(50.0, replace(rig, unit=1)), "static-field")
    assert abs(np.corrcoef(first.ravel(), other.ravel())[0, 1]) < 0.3


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


def test_lasting_speckle_stays_and_moves_with_the_surface() -> None:
    rig = make_rig(disparity_correlation=4.0, lasting_speckle=0.1, projector_power=0.2)
    rig = replace(rig, disparity_sigma=0.0)
    first, second = (error_of(make_frame(30.4, rig, number=number), "speckle") for number in (0, 1))
    np.testing.assert_array_equal(first, second)
    assert first.std() == pytest.approx(0.1, rel=0.1)
    assert (error_of(make_frame(30.4, replace(rig, unit=1)), "speckle") != first).mean() > 0.9
    nearer = error_of(make_frame(40.4, rig), "speckle", strength=2.0)
    np.testing.assert_allclose(nearer[:, :-10], 2 * first[:, 10:], atol=1e-5)


SHAPE = (240, 320)


def plane(metres: float) -> np.ndarray:
    """Depth of a wall across the view."""
    return np.full(SHAPE, metres, np.float32)


def step() -> np.ndarray:
    """A near half and a far half; the first column of the far one is 160."""
    depth = plane(1.0)
    depth[:, 160:] = 2.0
    return depth


@pytest.mark.parametrize("strength", [1.0, 3.0])
def test_disparity_noise_gives_the_quadratic_law(strength: float) -> None:
    rig = make_rig(disparity_sigma=0.1)
    for metres in (1.0, 2.0):
        error = worse_depth(plane(metres), rig, [DISPARITY_NOISE], strength=strength) - metres
        expected = strength * 0.1 * metres**2 / rig.focal_baseline
        assert np.std(error) == pytest.approx(expected, rel=0.03)
        assert abs(np.mean(error)) < 0.05 * expected


@pytest.mark.parametrize(("seed", "number"), [(0, 1), (1, 0)])
def test_other_frames_and_seeds_have_other_noise(seed: int, number: int) -> None:
    rig, gray = make_rig(disparity_sigma=0.1, image_noise=2.0), flat(SHAPE, 118)
    noisy = []
    for each in ((0, 0), (seed, number)):
        noisy.append(worse_depth(plane(1.0), rig, [DISPARITY_NOISE], *each))
        eyes = worse_images(gray, gray, rig, ["shot-noise", "read-noise"], *each)
        noisy += [eye[..., 0] for eye in eyes]
        assert np.std(eyes) == pytest.approx(2.0, rel=0.1)
    alike = np.corrcoef([each.ravel() for each in noisy])
    assert np.abs(alike - np.eye(6)).max() < 0.02


def test_a_static_field_is_that_of_the_unit() -> None:
    rig = make_rig(static_field=0.2, unit=3)
    worse = worse_depth(plane(1.0), rig, ["static-field"], strength=2.0)
    error = rig.focal_baseline / worse.astype(np.float64) - rig.focal_baseline
    np.testing.assert_allclose(error, 0.4 * unit_field(3, 320, 240), atol=1e-4)


def test_quantum_rounds_to_the_nearest_of_steps_that_grow() -> None:
    rig = make_rig(disparity_step=0.25)
    depth = np.linspace(0.5, 5.0, 240 * 320, dtype=np.float32).reshape(SHAPE)
    steps = rig.focal_baseline / worse_depth(depth, rig, ["quantum"], strength=2.0) / 0.5
    np.testing.assert_allclose(steps, np.rint(steps), atol=2e-4)
    off = np.abs(steps - rig.focal_baseline / depth / 0.5)
    assert 0.499 < off.max() < 0.5 + 2e-4


def test_depth_is_lost_beside_steps_as_far_as_half_a_window_reaches() -> None:
    rig = make_rig(window=5)
    for strength, reach in ((0.1, None), (0.5, 1), (1.0, 2), (4.0, 8)):
        lost = np.isnan(worse_depth(step(), rig, [STEP_HOLES], strength=strength))
        assert (lost == lost[0]).all()
        columns = np.flatnonzero(lost[0])
        # The two pixels at the step, and ``reach`` more to either side; nothing where that is no pixel.
        expected = [] if reach is None else [*range(159 - reach, 161 + reach)]
        assert columns.tolist() == expected


def test_what_no_effect_changes_keeps_its_bits() -> None:
    rig = make_rig()
    depth = np.linspace(0.05, 90.0, 240 * 320, dtype=np.float32).reshape(SHAPE)
    worse = worse_depth(depth, rig, EFFECTS_ON_RECORDINGS, strength=0.1)
    np.testing.assert_array_equal(worse, depth)  # also beyond the range of the rig, 0.2 to 20 m


def test_holes_stay_holes_and_noise_leaves_nothing_beyond_the_range() -> None:
    rig = make_rig(disparity_sigma=2.0)
    depth = plane(18.0)  # 2.8 px
    depth[:, :40] = np.nan
    worse = worse_depth(depth, rig, [DISPARITY_NOISE])
    assert np.isnan(worse[:, :40]).all()
    known = worse[np.isfinite(worse)]
    assert 0 < known.min() and known.max() <= 20.0 * (1 + 1e-5)
    assert np.isnan(worse[:, 40:]).mean() > 0.3  # less than 2.5 px: farther than 20 m
    nothing = np.full(SHAPE, np.nan, np.float32)
    np.testing.assert_array_equal(worse_depth(nothing, rig, [DISPARITY_NOISE]), nothing)
