"""The filters after matching, against float64 twins and what their formulas promise."""

from dataclasses import asdict

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.sim.sensor.filters import gray_of
from digs_warp.sim.sensor.frame import Cause, Sensed
from digs_warp.sim.sensor.post_filters.chain import (
    EARLIER_FRAMES,
    AfterMatching,
    Shot,
    smooth_over_time,
)
from digs_warp.sim.sensor.post_filters.dense import Smoothing, smooth_densely
from digs_warp.sim.sensor.post_filters.hole_filling import sources_of_holes
from digs_warp.sim.sensor.post_filters.names import FILTERS, filters_named
from digs_warp.sim.sensor.post_filters.spatial import ALPHA, DELTA, ITERATIONS, smooth_spatially
from reference.filter_twins import twin_dense, twin_filled, twin_spatial, twin_temporal
from reference.stereo_frames import broadband

SHAPES = [(1, 1), (1, 9), (9, 1), (2, 2), (7, 5), (24, 300)]
NAN = np.nan


def scene(shape: tuple[int, int], seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Disparity with noise, a step and holes, a confidence, and a textured gray image."""
    rng = np.random.default_rng(seed)
    disparity = 20 + 0.1 * np.arange(shape[1]) + rng.normal(0, 0.2, shape)
    disparity[:, shape[1] // 2 :] += 5
    disparity[rng.random(shape) < 0.2] = NAN
    confidence = rng.uniform(0.2, 1, shape).astype(np.float32)
    return disparity.astype(np.float32), confidence, gray_of(broadband(shape, seed))


def plane(shape: tuple[int, int] = (60, 90), slope: float = 0.05) -> np.ndarray:
    """True disparity of a slanted plane."""
    return (20 + slope * np.indices(shape).sum(axis=0)).astype(np.float32)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_spatial_filter_is_its_twin(shape: tuple[int, int]) -> None:
    disparity, _, _ = scene(shape)
    for alpha, delta, iterations in ((ALPHA, DELTA, ITERATIONS), (0.3, 6.0, 1), (1.0, 1.0, 3)):
        found = smooth_spatially(disparity, alpha, delta, iterations)
        twin = twin_spatial(disparity, alpha, delta, iterations)
        np.testing.assert_allclose(found, twin, atol=2e-5)
        assert found.dtype == np.float32


def test_the_spatial_filter_lowers_noise_as_its_formula_says() -> None:
    """Forth and back, the weights are a two-sided exponential; two iterations convolve it with itself."""
    noise = np.random.default_rng(3).normal(0, 0.05, (400, 400))
    found = smooth_spatially((30 + noise).astype(np.float32)) - 30
    once = 0.5 / (2 - 0.5) * 0.5 ** np.abs(np.arange(-40, 41))
    expected = np.sum(np.square(np.convolve(once, once)))  # along rows; as much along columns
    assert found[20:-20, 20:-20].std() / noise.std() == pytest.approx(expected, rel=0.05)


def test_the_spatial_filter_keeps_steps_and_slopes() -> None:
    disparity = plane((40, 60))
    np.testing.assert_allclose(
        smooth_spatially(disparity)[15:-15, 15:-15], disparity[15:-15, 15:-15], atol=1e-3
    )
    step = np.full((40, 60), 20, np.float32)
    step[:, 30:] = 25
    noisy = step + np.random.default_rng(1).normal(0, 0.05, step.shape).astype(np.float32)
    assert np.abs(smooth_spatially(noisy) - step).max() < 0.2
    # librealsense's default: 20 / 32 px.
    small, large = (np.where(step > 20, np.float32(20 + size), step) for size in (0.6, 0.65))
    np.testing.assert_array_equal(smooth_spatially(large), large)
    assert np.abs(smooth_spatially(small) - small).max() > 0.1


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("way", ["left", "farthest", "nearest"])
def test_holes_are_filled_as_by_the_twin(shape: tuple[int, int], way: str) -> None:
    disparity, _, _ = scene(shape)
    for holes in (disparity, np.where(np.indices(shape)[1] % 7 > 1, NAN, disparity)):
        holes = holes.astype(np.float32)
        found = np.take(holes, sources_of_holes(holes, way))  # pyright: ignore[reportArgumentType]
        np.testing.assert_array_equal(found, twin_filled(holes, way).astype(np.float32))


def test_holes_take_the_value_of_the_wanted_neighbor() -> None:
    holes = np.array([[9, 3, 8], [5, NAN, 4], [1, 7, 2]], np.float32)
    for way, value in (("left", 5), ("farthest", 3), ("nearest", 7)):
        filled = np.take(holes, sources_of_holes(holes, way))  # pyright: ignore[reportArgumentType]
        assert filled[1, 1] == value
        assert (filled == holes).sum() == 8
    row = np.array([[NAN, 4, NAN, NAN, 6]], np.float32)
    assert np.take(row, sources_of_holes(row, "left"))[0].tolist()[1:] == [4, 4, 4, 6]
    assert np.take(row, sources_of_holes(row, "farthest"))[0].tolist() == [4, 4, 4, 4, 6]
    assert np.take(row, sources_of_holes(row, "nearest"))[0].tolist() == [4, 4, 4, 6, 6]


@pytest.mark.parametrize("shape", SHAPES)
def test_the_dense_filter_is_its_twin(shape: tuple[int, int]) -> None:
    disparity, confidence, gray = scene(shape)
    for smoothing in (Smoothing(), Smoothing(200, 30, 4, 0.3)):
        found, trust = smooth_densely(disparity, confidence, gray, smoothing)
        twin, twin_trust = twin_dense(disparity, confidence, gray, **asdict(smoothing))
        np.testing.assert_allclose(found, twin, atol=2e-4)
        np.testing.assert_allclose(trust, twin_trust, atol=1e-5)


def test_the_dense_filter_makes_flying_pixels_at_steps_and_none_on_planes() -> None:
    shape = (60, 90)
    noise = np.random.default_rng(2).normal(0, 0.1, shape).astype(np.float32)
    holes = np.random.default_rng(3).random(shape) < 0.1
    trust, gray = np.ones(shape, np.float32), gray_of(broadband(shape))
    flat = plane(shape)
    found, _ = smooth_densely(np.where(holes, NAN, flat + noise), trust, gray)
    assert np.abs(found - flat).max() < 0.5
    step = flat + np.where(np.arange(shape[1]) < 45, 0, 10).astype(np.float32)
    found, _ = smooth_densely(np.where(holes, NAN, step + noise), trust, gray)
    middle = (found - flat > 1.5) & (found - flat < 8.5)
    assert 0.5 < middle.sum() / shape[0] < 2.5
    assert not middle[:, :40].any() and not middle[:, 50:].any()


def test_the_dense_filter_loses_detail_and_most_holes() -> None:
    shape = (60, 90)
    trust, gray = np.ones(shape, np.float32), np.full(shape, 128, np.uint8)
    thin = np.full(shape, 20, np.float32)
    thin[:, 41] = 24
    assert np.abs(smooth_densely(thin, trust, gray)[0] - thin)[:, 41].min() > 1
    holes = np.full(shape, 20, np.float32)
    holes[20:26, 30:36] = NAN
    holes[:, 50:] = NAN
    found, confidence = smooth_densely(holes, trust, gray)
    assert found[20:26, 30:36] == pytest.approx(20, abs=1e-4)
    assert (confidence[22:24, 32:34] < 0.9).all() and (confidence[40:50, 10:20] > 0.99).all()
    assert np.isnan(found[:, 80:]).all()


@pytest.mark.parametrize("shape", SHAPES)
def test_the_temporal_filter_is_its_twin(shape: tuple[int, int]) -> None:
    frames = [scene(shape, seed)[:2] for seed in range(4)]
    for count in (1, 2, 4):
        for alpha, delta in ((0.4, 20 / 32), (0.7, 3.0)):
            found, trust = smooth_over_time(frames[:count], alpha, delta)
            twin, twin_trust = twin_temporal(frames[:count], alpha, delta)
            np.testing.assert_allclose(found, twin, atol=1e-5)
            np.testing.assert_array_equal(trust, twin_trust)


def test_the_temporal_filter_lowers_what_changes_and_keeps_what_stays() -> None:
    rng = np.random.default_rng(5)
    shape = (200, 200)
    fixed = rng.normal(0, 0.3, shape)
    noise = rng.normal(0, 0.05, (1 + EARLIER_FRAMES, *shape))
    trust = np.ones(shape, np.float32)
    found, _ = smooth_over_time([((20 + fixed + n).astype(np.float32), trust) for n in noise])
    left = found - 20 - fixed
    weights = np.array([0.6**3, 0.4 * 0.6**2, 0.4 * 0.6, 0.4])
    assert left.std() / 0.05 == pytest.approx(np.linalg.norm(weights), rel=0.03)
    assert np.corrcoef(left.ravel(), fixed.ravel())[0, 1] == pytest.approx(0, abs=0.02)
    still = [((20 + fixed).astype(np.float32), trust)] * 4
    np.testing.assert_allclose(smooth_over_time(still)[0], still[0][0], rtol=1e-6)


def test_the_temporal_filter_follows_changes_and_bridges_gaps() -> None:
    frames = [
        [20, 20, 20, NAN, NAN, NAN],
        [20, 20, NAN, 20, 20, NAN],
        [20, NAN, NAN, NAN, 20, NAN],
        [27, NAN, NAN, 20, NAN, NAN],
    ]
    trust = np.full((1, 6), 0.5, np.float32)
    found, confidence = smooth_over_time([(np.array([f], np.float32), trust) for f in frames])
    np.testing.assert_array_equal(found[0], [27, 20, NAN, 20, 20, NAN])
    assert confidence[0].tolist() == [0.5, 0.5, 0, 0.5, 0.5, 0]


def test_filters_act_in_order_and_label_what_they_change() -> None:
    disparity, confidence, gray = scene((24, 300))
    cause = np.where(np.isnan(disparity), Cause.OCCLUDED, Cause.OK).astype(np.uint8)
    before = Sensed(disparity, cause, confidence * ~np.isnan(disparity))
    kept = before.own()
    after = AfterMatching(("dense", "spatial", "hole-filling")).apply([Shot(before, gray)])
    filled = np.isnan(disparity) & after.known
    moved = np.abs(after.disparity - disparity) > 1
    assert filled.any() and (after.cause[filled] == Cause.FILLED).all()
    assert moved.any() and (after.cause[moved] == Cause.FILTERED).all()
    assert (after.cause[~filled & ~moved] == cause[~filled & ~moved]).all()
    assert (after.known | ~before.known).all(), "no filter takes a value away"
    assert (after.confidence <= 1).all() and (after.confidence[~after.known] == 0).all()
    # The order of the names, and that nobody's arrays change.
    dense, trust = smooth_densely(disparity, before.confidence, gray)
    spatial = smooth_spatially(dense)
    source = sources_of_holes(spatial)
    np.testing.assert_array_equal(after.disparity, np.take(spatial, source))
    np.testing.assert_array_equal(after.confidence, np.take(trust, source))
    np.testing.assert_array_equal(before.disparity, kept.disparity)
    np.testing.assert_array_equal(before.confidence, kept.confidence)


def test_the_threshold_drops_exactly_what_is_below() -> None:
    disparity, confidence, gray = scene((24, 300))
    confidence[3, 4], disparity[3, 4] = np.float32(0.6), 21
    before = Sensed(disparity, np.zeros(disparity.shape, np.uint8), confidence, owned=True)
    kept = before.own()
    after = AfterMatching(threshold=0.6).apply([Shot(before, gray)])
    dropped = before.known & (confidence < np.float32(0.6))
    assert dropped.any() and after.known[3, 4]
    np.testing.assert_array_equal(after.known, before.known & ~dropped)
    assert (after.cause[dropped] == Cause.LOW_CONFIDENCE).all()
    assert (after.confidence[dropped] == 0).all()
    np.testing.assert_array_equal(before.disparity, kept.disparity)
    # In every frame, and before the filters: what it drops is filled again.
    shots = [Shot(before, gray)] * 4
    assert (AfterMatching(("temporal",), 0.6).apply(shots).known == after.known).all()
    assert AfterMatching(("hole-filling",), 0.6).apply([Shot(before, gray)]).known.all()


def test_the_threshold_holds_in_earlier_frames_too() -> None:
    def shot(value: float, confidence: float) -> Shot:
        disparity, trust = (np.full((2, 3), each, np.float32) for each in (value, confidence))
        gray = np.zeros((2, 3), np.uint8)
        return Shot(Sensed(disparity, gray, trust), gray)

    device = AfterMatching(("temporal",), 0.5)
    trusted, doubtful = ([*[shot(20, c)] * 3, shot(20.5, 0.9)] for c in (0.9, 0.1))
    np.testing.assert_allclose(device.apply(trusted).disparity, 20.2, rtol=1e-6)
    np.testing.assert_array_equal(device.apply(doubtful).disparity, 20.5)


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("shape", SHAPES)
def test_extreme_frames_pass_every_filter(name: str, shape: tuple[int, int]) -> None:
    gray = np.zeros(shape, np.uint8)
    empty = Sensed(
        np.full(shape, NAN, np.float32), np.zeros(shape, np.uint8), np.zeros(shape, np.float32)
    )
    assert not AfterMatching((name,), 0.5).apply([Shot(empty, gray)]).known.any()
    full = Sensed(np.full(shape, 7, np.float32), empty.cause, np.ones(shape, np.float32))
    after = AfterMatching((name,), 1.0).apply([Shot(full, gray)])
    np.testing.assert_allclose(after.disparity, 7, rtol=1e-6)
    np.testing.assert_allclose(after.confidence, 1, rtol=1e-5)
    assert (after.cause == Cause.OK).all()
    untrusted = Sensed(full.disparity, empty.cause, np.zeros(shape, np.float32))
    np.testing.assert_array_equal(
        AfterMatching((name,)).apply([Shot(untrusted, gray)]).disparity, 7
    )


def test_filters_are_named_in_any_order() -> None:
    assert filters_named("none") == ()
    assert filters_named("hole-filling, spatial") == ("spatial", "hole-filling")
    with pytest.raises(DigsError, match=r"--filters: no filter 'spatal'; did you mean 'spatial'"):
        filters_named("spatal")
    with pytest.raises(DigsError, match=r"--filters: no filter ''"):
        filters_named("")
    with pytest.raises(DigsError, match="name one of them"):
        filters_named("hole-filling,hole-filling-left")
