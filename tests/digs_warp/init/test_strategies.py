"""The five strategies, on a ball whose surface is known in closed form."""

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.data.sfm_model import SfmModel
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initialize
from reference.ball_capture import INTRINSICS, RADIUS
from reference.synthetic_sfm import sfm_from_truth

SFM_PER_METRE = 2.5


@pytest.fixture(scope="module")
def sfm(ball_ring: Capture) -> SfmModel:
    return sfm_from_truth(ball_ring.frames, SFM_PER_METRE, points=3000)


@pytest.fixture(scope="module")
def metric(sfm: SfmModel) -> SfmModel:
    return sfm.in_metres(SFM_PER_METRE)


def radii(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points, axis=1)


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


# Depth maps and masks at their worst: the whole recipe has to give points on the ball, or say why not.
