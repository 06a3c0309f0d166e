"""The strategies, on a ball whose surface is known in closed form, and the scale of a model."""

import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud, write_points
from digs_warp.data.sfm_model import SfmModel
from digs_warp.init.config import InitConfig
from digs_warp.init.depth_points import NoPointsError
from digs_warp.init.recipes import initialize
from digs_warp.init.scale import estimate_scale, local_scales
from digs_warp.init.sparse_points import FEWEST, recorded_points
from reference.ball_capture import INTRINSICS, RADIUS, ball_views, radii, write_capture
from reference.synthetic_sfm import sfm_from_truth

SFM_PER_METRE = 2.5


@pytest.fixture(scope="module")
def sfm(ball_ring: Capture) -> SfmModel:
    return sfm_from_truth(ball_ring.frames, SFM_PER_METRE, points=3000)


@pytest.fixture(scope="module")
def metric(sfm: SfmModel) -> SfmModel:
    return sfm.in_metres(SFM_PER_METRE)


def test_depth_is_coarser_than_highdepth_by_the_papers_ratio(ball_ring: Capture) -> None:
    high = initialize(ball_ring.frames, InitConfig(strategy="highdepth"))
    low = initialize(ball_ring.frames, InitConfig(strategy="depth"))
    assert high.depth is not None and low.depth is not None
    assert low.depth.voxel_size / high.depth.voxel_size == pytest.approx(0.1 / 0.04)
    assert len(low.points) < len(high.points)
    for found, size in ((high, high.depth.voxel_size), (low, low.depth.voxel_size)):
        # The mean of a curved patch lies below the surface, by the square of its width.
        below = size**2 / (4 * RADIUS)
        np.testing.assert_allclose(radii(found.points.points_world), RADIUS, atol=below)


def test_fusion_rejects_by_brute_force_what_the_formula_rejects(
    ball_ring: Capture, metric: SfmModel
) -> None:
    masks = {frame.name: frame.load_mask() for frame in ball_ring.frames}
    box = initialize(ball_ring.frames, InitConfig()).points.bounds
    kept = []
    for j, point in enumerate(metric.points.points_world):
        rows = np.flatnonzero(metric.observations.points == j)
        inside = [
            masks[metric.names[metric.observations.cameras[row]]][
                min(int(metric.observations.px[row, 1]), 59),
                min(int(metric.observations.px[row, 0]), 79),
            ]
            > 20
            for row in rows
        ]
        if rows.size and all(inside) and np.all(point >= box[0]) and np.all(point <= box[1]):
            kept.append(point)
    found = initialize(ball_ring.frames, InitConfig(strategy="fusion"), metric)
    np.testing.assert_array_equal(found.points.points_world[found.sources["depth"] :], kept)


def test_random_points_fill_the_cube_that_the_cameras_look_at(
    ball_ring: Capture, metric: SfmModel
) -> None:
    found = initialize(ball_ring.frames, InitConfig(strategy="random"), metric)
    assert len(found.points) == len(metric.points)
    distance = 0.9 * np.hypot(1.0, 0.3)
    half = distance * 30 / INTRINSICS.fy
    low, high = found.points.bounds
    np.testing.assert_allclose([low, high], [[-half] * 3, [half] * 3], atol=0.01 * half)
    again = initialize(ball_ring.frames, InitConfig(strategy="random"), metric)
    np.testing.assert_array_equal(again.points.points_world, found.points.points_world)
    asked = initialize(ball_ring.frames, InitConfig(strategy="random", target_points=77))
    assert len(asked.points) == 77


def test_the_report_counts_what_each_filter_leaves(ball_ring: Capture) -> None:
    found = initialize(ball_ring.frames, InitConfig())
    assert found.depth is not None
    in_mask = sum(np.count_nonzero(frame.load_mask() > 20) for frame in ball_ring.frames)
    counts = list(found.depth.pixels.values())
    assert counts[0] == counts[1] == in_mask
    assert counts == sorted(counts, reverse=True)
    assert found.depth.pixels["away from edges"] < in_mask
    assert found.depth.voxels["on the surface"] == len(found.points)


HULL = InitConfig(strategy="hull")


@pytest.fixture(scope="module")
def frames(ball_ring: Capture) -> list[Frame]:
    """Photographs and masks, without depth."""
    return [frame.without_layer(Layer.DEPTH) for frame in ball_ring.frames]


def test_the_hull_of_a_ball_is_the_ball_but_for_what_no_view_touches(frames: list[Frame]) -> None:
    start = initialize(frames, HULL)
    assert set(start.sources) == {"hull"} and "no depth" in start.because
    points = start.points.points_world
    radii = np.linalg.norm(points, axis=1)
    pixel = 0.9 / INTRINSICS.fx
    edge = 2 * pixel
    assert (radii > RADIUS - np.sqrt(3) * edge).all()
    # At the poles, which no silhouette touches, the hull of a ring of cameras reaches above the ball.
    beside = np.abs(points[:, 2]) < 0.5 * RADIUS
    assert np.median(radii[beside]) == pytest.approx(RADIUS, abs=2 * pixel)
    # Every direction has a point.
    directions = np.random.default_rng(0).normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert (directions @ (points / radii[:, None]).T).max(axis=1).min() > 0.98


def test_points_have_the_colors_of_the_side_on_which_they_lie(frames: list[Frame]) -> None:
    cloud = initialize(frames, HULL).points
    beside = np.abs(cloud.points_world[:, 2]) < 0.5 * RADIUS
    normals = cloud.points_world / np.linalg.norm(cloud.points_world, axis=1, keepdims=True)
    errors = np.abs(cloud.colors - (normals + 1) / 2)[beside]
    assert np.median(errors) < 0.05 and np.quantile(errors, 0.95) < 0.2


def test_a_mask_that_misses_the_object_in_one_view_of_many_does_not_cut_it(tmp_path: Path) -> None:
    capture = write_capture(tmp_path, ball_views(24))
    frames = [frame.without_layer(Layer.DEPTH) for frame in capture.frames]
    whole = len(initialize(frames, HULL).points)
    frames[3] = frames[3].with_layer(Layer.MASK, np.zeros((60, 80), np.uint8))
    assert len(initialize(frames, HULL).points) == pytest.approx(whole, rel=0.1)


def test_masks_that_agree_on_no_place_are_named(frames: list[Frame]) -> None:
    """Each view has its object in another corner."""
    corners = []
    for number, frame in enumerate(frames):
        mask = np.zeros((60, 80), np.uint8)
        mask[:8, :8] = 255
        corners.append(
            frame.with_layer(Layer.MASK, np.ascontiguousarray(np.rot90(mask, 2 * (number % 2))))
        )
    with pytest.raises(NoPointsError, match="inside the masks of the 12 views"):
        initialize(corners, HULL)


Sparse = Callable[[np.ndarray], Capture]


@pytest.fixture
def with_points(tmp_path: Path) -> Sparse:
    """Return a capture without depth that has the given points."""
    capture = write_capture(tmp_path / "capture", ball_views(4))
    frames = tuple(frame.without_layer(Layer.DEPTH) for frame in capture.frames)

    def make(points: np.ndarray) -> Capture:
        write_points(tmp_path / "points.ply", PointCloud(points, np.full(points.shape, 0.5)))
        return replace(capture, frames=frames, points=tmp_path / "points.ply")

    return make


def near_the_middle(count: int) -> np.ndarray:
    return np.random.default_rng(0).uniform(-0.1, 0.1, (count, 3))


def test_points_that_no_view_shows_are_left_out(with_points: Sparse) -> None:
    above = np.array([[0.0, 0.0, 50.0], [0.0, 0.0, -50.0]])
    capture = with_points(np.concatenate([near_the_middle(300), above]))
    cameras = [frame.camera for frame in capture.frames]
    found = recorded_points(capture, cameras)
    assert found is not None and len(found) == 300
    start = initialize(capture.frames, InitConfig(strategy="default"), recorded=found)
    assert start.sources == {"recorded": 300}
    assert start.because == "the sparse points of the recording, which has no depth"


def test_too_few_points_are_as_good_as_none(with_points: Sparse, caplog) -> None:
    capture = with_points(near_the_middle(FEWEST - 1))
    assert recorded_points(capture, [frame.camera for frame in capture.frames]) is None
    assert "too few to start from" in caplog.text


TRUE = 1.7


def noisy(count: int, deviation: float, outliers: float = 0.0, seed: int = 0) -> np.ndarray:
    """A normal peak at TRUE with a relative ``deviation``; a share of outliers anywhere up to 8."""
    rng = np.random.default_rng(seed)
    peak = TRUE * (1 + deviation * rng.normal(size=round(count * (1 - outliers))))
    return rng.permutation(np.append(peak, rng.uniform(0.05, 8.0, count - len(peak))))


# sigma_ij of stereo spreads by about 0.5 % at the object and 3 % at a surround of 4 m.
@pytest.mark.parametrize(("deviation", "outliers"), [(0.002, 0.9), (0.03, 0.3)])
def test_a_million_values_tell_the_mode_to_a_thousandth(deviation: float, outliers: float) -> None:
    found = estimate_scale(noisy(1_000_000, deviation, outliers))
    assert found.sfm_per_metre == pytest.approx(TRUE, rel=1e-3)
    assert found.width == pytest.approx(TRUE * deviation, rel=0.25)
    assert found.values == 1_000_000


def test_few_values_give_one_of_their_range_and_the_unit_does_not_matter() -> None:
    for values in (
        *(noisy(count, 0.02, seed=count) for count in (1, 2, 5, 50)),
        np.full(5000, 0.3),
    ):
        scale = estimate_scale(values).sfm_per_metre
        assert values.min() - 0.02 <= scale <= values.max() + 0.02
        for unit in (1e-6, 1e6):
            other = estimate_scale(values * unit).sfm_per_metre
            assert other == pytest.approx(scale * unit, rel=1e-4)


def test_junk_does_not_count_and_nothing_else_raises() -> None:
    values, junk = noisy(1000, 0.01), [np.nan, np.inf, -np.inf, 0.0, -1.0]
    assert estimate_scale(np.append(values, junk * 1000)) == estimate_scale(values)
    for unusable in ([], junk):
        with pytest.raises(DigsError, match=f"scale: {len(unusable)} points .*--poses capture"):
            estimate_scale(np.array(unusable))


def test_two_modes_as_high_as_each_other_are_told(caplog) -> None:
    # Half of the frames in feet: both peaks have the same height when their values do not scale along.
    peak = noisy(20_000, 0.01)
    values = np.append(peak, peak + 2.0)
    with caplog.at_level(logging.WARNING):
        found = estimate_scale(values)
    assert min(abs(found.sfm_per_metre - mode) for mode in (TRUE, TRUE + 2.0)) < 0.005
    assert "a second mode at" in caplog.text


def test_wild_values_and_their_order_do_not_matter() -> None:
    values = noisy(5000, 0.01, 0.2)
    before = values.copy()
    wild = estimate_scale(np.append(values, [1e6, 1e9, 1e-9]))
    assert wild.sfm_per_metre == pytest.approx(TRUE, rel=5e-3)
    assert estimate_scale(values[::-1].reshape(50, 100)) == estimate_scale(values)
    np.testing.assert_array_equal(values, before)


def test_measured_depth_scales_a_model(ball_ring: Capture, caplog) -> None:
    frames = ball_ring.frames
    model = sfm_from_truth(frames, TRUE, points=4000)
    config = InitConfig(edge_filter=False)
    ratios = local_scales(model, frames[2:], config)
    assert estimate_scale(ratios).sfm_per_metre == pytest.approx(TRUE, rel=2e-3)
    assert "inside the masks" not in caplog.text
    few = local_scales(sfm_from_truth(frames, TRUE, points=60), frames, config)
    assert "inside the masks" in caplog.text  # the whole image counts
    assert estimate_scale(few).sfm_per_metre == pytest.approx(TRUE, rel=5e-3)
    strangers = [replace(frame, name="x" + frame.name) for frame in frames]
    with pytest.raises(DigsError, match="registered none of the 12 training frames"):
        local_scales(model, strangers, config)
