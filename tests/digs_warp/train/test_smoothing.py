"""The filter in 3D against its twin: s_eff^2 = s^2 + c p^2, p the finest pixel at a splat."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import CLASSIC
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.measure.metrics import psnr
from digs_warp.show.film.camera_path import find_subject, orbit
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.footprint import near_plane
from digs_warp.splat.render import render
from digs_warp.train.smoothing import (
    BLOCK,
    OWN_SHARE,
    SAMPLED_EVERY,
    VARIANCE,
    SmoothingFilter,
    for_classic_viewers,
    sampling_distances,
)
from reference.splat_scenes import random_gaussians
from reference.tiny_capture import ball

# Crosses a block of the kernels, and ends within one.
COUNT = BLOCK // 3 + 77


def sampling_distances_twin(
    means: np.ndarray, cameras: Sequence[Camera], nears: Sequence[float]
) -> np.ndarray:
    """Return the size of a pixel [m] of the finest view, else of the nearest camera, (n,)."""
    finest, nearest = np.full((2, len(means)), np.inf)
    for camera, near in zip(cameras, nears, strict=True):
        k = camera.intrinsics
        focal = max(k.fx, k.fy)
        away = means.astype(np.float64) - camera.center_world
        nearest = np.minimum(nearest, np.linalg.norm(away, axis=1) / focal)
        px, z = camera.project(means.astype(np.float64))
        seen = (z > near) & (px >= 0).all(axis=1) & (px <= [k.width, k.height]).all(axis=1)
        finest = np.where(seen, np.minimum(finest, z / focal), finest)
    return np.where(np.isfinite(finest), finest, nearest)


def effective_twin(log_scales: np.ndarray, distances: np.ndarray, share: float) -> np.ndarray:
    """Return ln s_eff of learned ln s, (n, 3); ``share``: c."""
    variances = np.exp(2.0 * log_scales.astype(np.float64))
    return 0.5 * np.log(variances + share * np.square(distances)[:, None])


def views() -> list[Camera]:
    """Three views of the origin: one near and small, one far and fine, one that looks away."""
    cameras = []
    for width, distance, forward in ((64, 2.0, -1.0), (400, 4.0, -1.0), (64, 2.0, 1.0)):
        pose = np.diag([1.0, forward, forward, 1.0])
        pose[2, 3] = distance
        cameras.append(Camera(Intrinsics.from_fov(width, width * 3 // 4, 40.0), pose))
    return cameras


def filtered(seed: int = 0) -> tuple[DeviceGaussians, DeviceGaussians, SmoothingFilter]:
    """Return Gaussians, their gradients, and a filter of them."""
    gaussians = DeviceGaussians.from_numpy(random_gaussians(COUNT, seed=seed, degree=0))
    gradients = gaussians.zeros_like()
    return gaussians, gradients, SmoothingFilter(gaussians, gradients, views())


def test_sampling_distances_equal_the_twin() -> None:
    means = np.random.default_rng(0).normal(scale=0.8, size=(500, 3)).astype(np.float32)
    means[0] = (50.0, 0.0, 0.0)  # in no image
    cameras = views()
    nears = [near_plane(camera, means.mean(axis=0)) for camera in cameras]
    found = sampling_distances(wp.array(means, dtype=wp.vec3), cameras).numpy()
    np.testing.assert_allclose(found, sampling_distances_twin(means, cameras, nears), rtol=2e-5)
    assert len(set(np.round(found / found.min(), 1))) > 3


def test_learned_and_effective_scales_and_gradients_equal_the_twin() -> None:
    gaussians, gradients, smoothing = filtered()
    distances = smoothing.distances.numpy().astype(np.float64)
    learned = smoothing.learned.numpy()
    expected = effective_twin(learned, distances, VARIANCE)
    np.testing.assert_allclose(gaussians.log_scales.numpy(), expected, rtol=1e-5, atol=2e-6)
    given = np.random.default_rng(1).normal(size=(COUNT, 3)).astype(np.float32)
    gradients.log_scales.assign(given)
    smoothing.before_update()
    np.testing.assert_array_equal(gaussians.log_scales.numpy(), learned)
    step = 1e-6
    slope = (
        effective_twin(learned.astype(np.float64) + step, distances, VARIANCE)
        - effective_twin(learned.astype(np.float64) - step, distances, VARIANCE)
    ) / (2 * step)
    np.testing.assert_allclose(gradients.log_scales.numpy(), given * slope, rtol=2e-5, atol=1e-6)
    moved = learned - 0.3
    gaussians.log_scales.assign(moved)
    smoothing.after_update()
    np.testing.assert_array_equal(smoothing.learned.numpy(), moved)
    expected = effective_twin(moved, distances, VARIANCE)
    np.testing.assert_allclose(gaussians.log_scales.numpy(), expected, rtol=1e-5, atol=2e-6)


def test_a_classic_viewer_shows_what_we_show_at_the_size_it_is_for() -> None:
    """Splats of a ball, somewhat wider than the filter makes them at that size."""
    ours = ball()
    camera = orbit(find_subject(ours), Intrinsics.from_fov(160, 120, 40.0), 3)[1]
    p = sampling_distances(wp.array(ours.means, dtype=wp.vec3), [camera]).numpy()
    widths = p[:, None] * np.random.default_rng(4).uniform(0.7, 1.5, (len(ours), 3))
    ours = replace(ours, log_scales=np.log(widths))
    classic = for_classic_viewers(ours, [camera])
    assert classic.screen_filter == CLASSIC
    expected = render(ours, camera).image
    as_it_is = render(replace(ours, screen_filter=CLASSIC), camera).image
    assert psnr(render(classic, camera).image, expected) > 45
    assert psnr(as_it_is, expected) < 35
    with pytest.raises(DigsError, match="already made for viewers"):
        for_classic_viewers(classic, [camera])


def test_a_start_keeps_its_size_unless_it_is_thinner_than_the_filter() -> None:
    start = random_gaussians(COUNT, seed=0, degree=0)
    thin = np.arange(COUNT) % 2 == 0
    start.log_scales[thin] = -20.0
    gaussians = DeviceGaussians.from_numpy(start)
    smoothing = SmoothingFilter(gaussians, gaussians.zeros_like(), views())
    added = VARIANCE * np.square(smoothing.distances.numpy())[:, None]
    variances = np.exp(2.0 * gaussians.log_scales.numpy().astype(np.float64))
    before = np.exp(2.0 * start.log_scales.astype(np.float64))
    wide = added < (1.0 - OWN_SHARE) * before
    assert wide.any()
    np.testing.assert_allclose(variances[wide], before[wide], rtol=1e-5)
    np.testing.assert_allclose(variances[thin], np.broadcast_to(added, (COUNT, 3))[thin], rtol=1e-5)


def test_distances_follow_the_splats_now_and_then() -> None:
    gaussians, _, smoothing = filtered()
    before = smoothing.distances.numpy().copy()
    gaussians.means.assign(gaussians.means.numpy() + np.float32(0.1))
    smoothing.before_update()
    smoothing.after_update(SAMPLED_EVERY - 1)
    np.testing.assert_array_equal(smoothing.distances.numpy(), before)
    smoothing.before_update()
    smoothing.after_update(SAMPLED_EVERY)
    assert (smoothing.distances.numpy() != before).mean() > 0.9


def test_extreme_scales_stay_what_they_are() -> None:
    gaussians, _, smoothing = filtered()
    for value in (100.0, -100.0, np.nan):
        smoothing.before_update()
        gaussians.log_scales.fill_(value)
        smoothing.after_update()
        found = gaussians.log_scales.numpy()
        expected = {100.0: np.isfinite(found) & (found > 40), -100.0: found < 0}
        assert expected.get(value, np.isnan(found)).all()
