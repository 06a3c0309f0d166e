"""The scores of the realism benchmark, of boards and of edges on errors that are known."""

import numpy as np
import pytest

from reference.error_shapes import autocorrelation, small_error_rms
from studies.boards_and_edges import edge, plane_error
from studies.error_patches import auc_of_classifier, patch_features
from studies.realism_scores import (
    agreement,
    bad_share,
    median_where_most,
    repeated_bad,
    small_hole_share,
    temporal_share,
)

TRUE = np.full((160, 240), 20.0)


def noisy(seed: int, sigma: np.ndarray | float = 0.2, correlation: int = 0) -> np.ndarray:
    from scipy.ndimage import gaussian_filter

    error = np.random.default_rng(seed).standard_normal(TRUE.shape)
    if correlation:
        error = gaussian_filter(error, correlation)
        error /= error.std()
    return TRUE + sigma * error


def test_errors_in_the_same_places_agree_and_in_others_do_not() -> None:
    rng = np.random.default_rng(0)
    places = rng.uniform(0.05, 0.6, (8, 12)).repeat(20, 0).repeat(20, 1)
    other_places = rng.permuted(places.ravel()).reshape(places.shape)
    failures, rms = agreement(noisy(1, places), noisy(2, places), TRUE)
    assert failures > 0.7 and rms > 0.9
    failures, rms = agreement(noisy(1, places), noisy(2, other_places), TRUE)
    assert abs(failures) < 0.4 and abs(rms) < 0.4


def test_a_classifier_tells_the_texture_of_errors_and_not_their_draw() -> None:
    def patches(first: int, correlation: int) -> list[np.ndarray]:
        return [
            patch_features(noisy(seed, correlation=correlation) - TRUE)
            for seed in range(first, first + 3)
        ]

    assert auc_of_classifier(patches(0, 2), patches(10, 2)) == pytest.approx(0.5, abs=0.12)
    assert auc_of_classifier(patches(0, 0), patches(10, 2)) > 0.99


def test_shares_of_bad_pixels_and_small_holes() -> None:
    disparity = TRUE.copy()
    disparity[:40] += 2  # a quarter is bad
    assert bad_share(disparity, TRUE, np.ones(TRUE.shape, bool)) == pytest.approx(0.25)
    assert np.isnan(bad_share(disparity, TRUE, np.zeros(TRUE.shape, bool)))
    assert small_hole_share(disparity) == 0
    disparity[100:110, 100:110] = np.nan
    disparity[150, 10:110:10] = np.nan  # ten single pixels beside a hole of 100
    assert small_hole_share(disparity) == pytest.approx(10 / 110)
    assert small_hole_share(disparity, 99) == pytest.approx(10 / 110)
    assert small_hole_share(disparity, 100) == 1


def test_small_errors_and_their_autocorrelation() -> None:
    disparity = noisy(0, 0.2)
    disparity[::7] += 5  # wrong, and not among the small errors
    assert small_error_rms(disparity, TRUE) == pytest.approx(0.2, rel=0.02)
    assert np.isnan(small_error_rms(TRUE + 3, TRUE))
    assert abs(autocorrelation(disparity, TRUE, 4, 1)) < 0.02
    smooth = noisy(0, 0.2, correlation=3)
    for lag in (2, 5):  # white noise after a Gaussian filter of sigma s: exp(-lag^2 / 4 s^2)
        for axis in (0, 1):
            expected = np.exp(-(lag**2) / 36)
            assert autocorrelation(smooth, TRUE, lag, axis) == pytest.approx(expected, abs=0.06)
    waves = TRUE + 0.3 * np.sin(np.arange(240) * np.pi / 8)  # a period of 16 px along the rows
    assert autocorrelation(waves, TRUE, 8, 1) == pytest.approx(-1, abs=0.05)
    assert autocorrelation(waves, TRUE, 8, 0) == pytest.approx(1)


def test_what_stays_from_frame_to_frame_is_told_from_what_changes() -> None:
    fixed = noisy(99, 0.6) - TRUE
    still = np.stack([TRUE + fixed] * 8)
    moving = np.stack([noisy(seed, 0.6) for seed in range(8)])
    assert temporal_share(still, TRUE) == pytest.approx(0, abs=1e-9)
    assert temporal_share(moving, TRUE) == pytest.approx(1, abs=0.02)
    assert temporal_share(moving + fixed, TRUE) == pytest.approx(0.5, abs=0.02)
    assert repeated_bad(still, TRUE) == 1
    assert repeated_bad(moving, TRUE) == pytest.approx((np.abs(fixed) > 1).mean(), abs=0.01)


def test_the_median_needs_more_than_half_of_the_frames() -> None:
    stack = np.full((5, 1, 3), np.nan)
    stack[:, 0, 0] = [3, 1, 2, 5, 4]
    stack[:4, 0, 1] = [1, 2, 3, 10]
    stack[:2, 0, 2] = 7
    np.testing.assert_array_equal(median_where_most(stack), [[3, 2.5, np.nan]])


SHAPE = (240, 320)


def test_points_off_a_tilted_plane_are_measured_at_right_angles_to_it() -> None:
    focal, tilt = 400.0, 0.5
    columns = (np.arange(SHAPE[1]) + 0.5 - SHAPE[1] / 2) / focal
    depth = np.tile(1.0 / (1 - tilt * columns), (SHAPE[0], 1))  # z = 1 + tilt * x
    assert plane_error(depth, focal)[0] == pytest.approx(0, abs=1e-9)
    assert plane_error(depth, focal)[1] == pytest.approx(1.0)
    off = np.where(np.random.default_rng(0).random(SHAPE) < 0.5, 0.001, -0.001)
    rmse, distance = plane_error(depth + off, focal)
    assert rmse < 0.00105 and distance == pytest.approx(1.0, abs=1e-4)


def test_an_edge_is_as_wide_as_its_ramp() -> None:
    columns = np.tile(np.arange(SHAPE[1]) + 0.5, (SHAPE[0], 1))
    place = columns - 160.0
    sharp = edge(np.where(place < 0, 1.0, 1.3), place, 20)
    assert sharp.width == pytest.approx(3.2), "strips of two pixels, half of each side in one"
    assert (sharp.mixed, sharp.missing) == (0, 0)
    ramp = np.clip(1.15 + 0.3 * place / 10, 1.0, 1.3)
    ramp[:, 150] = np.nan
    wide = edge(ramp, place, 20)
    assert wide.mixed == pytest.approx(10 / 39), "but 10 mm of each side"
    assert wide.missing == pytest.approx(1 / 40)
    noise = 0.02 * np.random.default_rng(0).standard_normal(SHAPE)
    assert edge(np.where(place < 0, 1.0, 1.3) + noise, place, 20).mixed < 0.005, (
        "noise is no mixture"
    )
