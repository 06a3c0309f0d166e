"""Errors added to recorded frames, against the closed-form law of stereo and the figures of the rig."""

import numpy as np
import pytest

from digs_warp.sim.sensor.effects.disparity_errors import unit_field
from digs_warp.sim.sensor.on_recordings import (
    DISPARITY_NOISE,
    EFFECTS_ON_RECORDINGS,
    STEP_HOLES,
    worse_depth,
    worse_images,
)
from reference.stereo_frames import flat, make_rig

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


def test_quantum_rounds_to_steps_that_grow() -> None:
    rig = make_rig(disparity_step=0.25)
    depth = np.linspace(0.5, 5.0, 240 * 320, dtype=np.float32).reshape(SHAPE)
    steps = rig.focal_baseline / worse_depth(depth, rig, ["quantum"], strength=2.0) / 0.5
    np.testing.assert_allclose(steps, np.rint(steps), atol=2e-4)


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
