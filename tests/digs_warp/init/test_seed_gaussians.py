"""Seeding: closed forms for the scale, and finite Gaussians whatever the points are."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.gaussians import FIELDS
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.sh import rgb_from_sh
from digs_warp.init.config import InitConfig
from digs_warp.init.seeds import (
    GUESSED_OPACITY,
    LEAST_OPACITY,
    LONELY_SCALE,
    MAX_SCALE_RATIO,
    MIN_SCALE_RATIO,
    SCENE_OPACITY,
    neighbor_scales,
    seed_gaussians,
    seed_start,
)


def grid(side: int, spacing: float) -> np.ndarray:
    return np.stack(np.meshgrid(*[np.arange(side) * spacing] * 3), axis=-1).reshape(-1, 3)


def test_brute_force_distances_agree() -> None:
    points = np.random.default_rng(0).uniform(0, 1, (200, 3))
    squared = np.sort(((points[:, None] - points[None]) ** 2).sum(axis=-1), axis=1)[:, 1:4]
    np.testing.assert_allclose(neighbor_scales(points), np.sqrt(squared.mean(axis=1)))


def test_a_stray_point_and_a_duplicate_stay_within_the_limits() -> None:
    points = np.concatenate([grid(5, 0.01), [[50.0, 0, 0]], np.full((4, 3), 0.005)])
    scales = neighbor_scales(points)
    typical = np.median(scales)
    assert scales[125] == pytest.approx(MAX_SCALE_RATIO * typical)
    np.testing.assert_allclose(scales[126:], MIN_SCALE_RATIO * typical)


@pytest.mark.parametrize(
    ("count", "sh_degree", "duplicates"),
    [(0, 0, False), (1, 3, False), (2, 0, False), (4, 3, True)],
)
def test_few_points_and_duplicates_give_finite_gaussians(
    count: int, sh_degree: int, duplicates: bool
) -> None:
    points = np.zeros((count, 3)) if duplicates else np.eye(4, 3)[:count]
    gaussians = seed_gaussians(PointCloud(points, np.full((count, 3), 0.5)), sh_degree)
    assert len(gaussians) == count
    assert gaussians.sh_degree == sh_degree
    for name in FIELDS:
        assert np.isfinite(getattr(gaussians, name)).all(), name
    if duplicates and count > 1:
        np.testing.assert_allclose(gaussians.scales, MIN_SCALE_RATIO * LONELY_SCALE, rtol=1e-6)


def test_gaussians_show_the_colors_of_the_points_from_every_side() -> None:
    rng = np.random.default_rng(0)
    points = PointCloud(rng.normal(size=(50, 3)), rng.uniform(0, 1, (50, 3)))
    gaussians = seed_gaussians(points, sh_degree=2, opacity=0.25)
    directions = rng.normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    np.testing.assert_allclose(rgb_from_sh(gaussians.sh, directions), points.colors, atol=1e-6)
    np.testing.assert_array_equal(gaussians.means, points.points_world)
    np.testing.assert_allclose(gaussians.opacities, 0.25, rtol=1e-6)
    assert gaussians.quats.tolist() == [[0, 0, 0, 1]] * 50
    assert (np.ptp(gaussians.log_scales, axis=1) == 0).all()


def test_guessed_places_start_almost_transparent(tmp_path: Path) -> None:
    measured = PointCloud(grid(2, 0.02), np.full((8, 3), 0.5))
    guessed = PointCloud(grid(2, 0.02) + 1.0, np.full((8, 3), 0.5), guessed=np.ones(8, dtype=bool))
    PointCloud.joined([measured, guessed]).save(tmp_path / "points.npz")
    points = PointCloud.load(tmp_path / "points.npz").select(np.arange(12))
    opacities = seed_gaussians(points, opacity=0.8).opacities
    np.testing.assert_allclose(opacities, [0.8] * 8 + [GUESSED_OPACITY] * 4, rtol=1e-6)
    fainter = seed_gaussians(points, opacity=0.05).opacities
    np.testing.assert_allclose(fainter, 0.05, rtol=1e-6)
    assert PointCloud.joined([measured, measured]).guessed is None


def test_points_start_as_opaque_as_views_agree_with_them(tmp_path: Path) -> None:
    share = np.array([0.0, 0.3, 0.7, 1.0] * 2)
    doubtful = PointCloud(grid(2, 0.02), np.full((8, 3), 0.5), agreement=share)
    sparse = PointCloud(grid(2, 0.02) + 1.0, np.full((8, 3), 0.5))
    PointCloud.joined([doubtful, sparse]).save(tmp_path / "points.npz")
    points = PointCloud.load(tmp_path / "points.npz").select(np.arange(9))
    opacities = seed_gaussians(points, opacity=0.6).opacities
    np.testing.assert_allclose(opacities, [LEAST_OPACITY, 0.3, 0.6, 0.6] * 2 + [0.6], rtol=1e-6)
    whatever_they_say = seed_gaussians(points, opacity=0.6, least=0.6).opacities
    np.testing.assert_allclose(whatever_they_say, 0.6, rtol=1e-6)
    assert PointCloud.joined([sparse, sparse]).agreement is None


def test_the_longer_the_run_the_more_opaque_are_doubtful_points() -> None:
    depth = InitConfig()
    least = [seed_start(depth, "object", steps)[3] for steps in (0, 300, 500, 1000, 30_000)]
    np.testing.assert_allclose(np.array(least)[[0, 1, 3, 4]], [0.1, 0.1, 0.8, 0.8], rtol=1e-12)
    assert 0.1 < least[2] < 0.8
    sparse = seed_start(InitConfig(strategy="default"), "object", 100)
    assert sparse[3] == sparse[0] == 0.1


def test_a_scene_starts_less_opaque_unless_told_otherwise() -> None:
    scene = seed_start(InitConfig(), "scene", 1000)
    assert (scene[0], scene[3]) == (SCENE_OPACITY, LEAST_OPACITY)
    assert scene[2] > seed_start(InitConfig(), "object", 1000)[2]
    assert seed_start(InitConfig(strategy="default"), "scene", 1000)[0] == 0.1
