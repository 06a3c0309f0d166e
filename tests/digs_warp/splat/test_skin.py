"""The skin of a splat against a float64 twin, and what depends on it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.splat.config import EXPECTED, MEDIAN, REACH, RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.renderer import SplatRenderer
from digs_warp.splat.surface_depth import surface_depth
from reference.splat_scenes import random_gaussians

POSE = look_at(np.array([0.4, -3.0, 0.5]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
CAMERA = Camera(Intrinsics.from_fov(64, 48, 60.0), POSE)


def drawn(gaussians: Gaussians, depth_of: str, threads: int = 1) -> SplatRenderer:
    options = RasterOptions(outputs="depth", depth_of=depth_of)  # pyright: ignore[reportArgumentType]
    splats = DeviceGaussians.from_numpy(gaussians)
    renderer = SplatRenderer(splats, 64, 48, options=options, threads=threads)
    renderer.forward(CAMERA, near=0.01, background=np.zeros(3))
    return renderer


def one(opacity: float, scales: tuple[float, float, float], seed: int = 0) -> Gaussians:
    quats = Rotation.random(rng=np.random.default_rng(seed)).as_quat()[None]
    logit = np.log(opacity / (1 - opacity))
    center = np.array([[0.1, 0.2, -0.1]])
    return Gaussians(center, np.log([scales]), 3.0 * quats, np.array([logit]), np.ones((1, 1, 3)))


def twin(gaussians: Gaussians) -> float:
    """The planar depth `REACH` standard deviations in front of the center, on the ray through it."""
    mean, quat = gaussians.means[0].astype(np.float64), gaussians.quats[0].astype(np.float64)
    ray = mean - CAMERA.center_world
    distance = np.linalg.norm(ray)
    ray /= distance
    axes = Rotation.from_quat(quat).as_matrix()
    variances = np.exp(2.0 * gaussians.log_scales[0].astype(np.float64))
    inverse = axes @ np.diag(1.0 / variances) @ axes.T

    deviation = 1.0 / np.sqrt(ray @ inverse @ ray)
    return float((distance - REACH * deviation) * (ray @ CAMERA.world_from_cam[:3, 2]))


@pytest.mark.parametrize(
    ("opacity", "scales"),
    [
        (0.3, (0.1, 0.1, 0.1)),
        (0.99, (0.12, 0.05, 0.01)),
    ],
)
def test_depth_is_that_of_the_skin_whatever_the_opacity(
    opacity: float, scales: tuple[float, float, float]
) -> None:
    for seed in range(3):
        gaussians = one(opacity, scales, seed)
        view = drawn(gaussians, "skin")
        through = view.transmittance.to_numpy().reshape(48, 64)
        # Faint pixels divide by a small coverage: their depth is rounded more.
        clearest = np.unravel_index(through.argmin(), through.shape)
        depth = view.depth.to_numpy()[*clearest, EXPECTED]
        assert depth == pytest.approx(twin(gaussians), abs=2e-6)


def test_image_and_order_are_those_of_the_centers() -> None:
    gaussians = random_gaussians(200, seed=3)
    center, skin = drawn(gaussians, "center"), drawn(gaussians, "skin")
    assert np.array_equal(center.image.to_numpy(), skin.image.to_numpy())
    assert np.array_equal(center.transmittance.to_numpy(), skin.transmittance.to_numpy())
    near, far = skin.depth.to_numpy(), center.depth.to_numpy()
    assert np.all(near[..., EXPECTED] <= far[..., EXPECTED] + 1e-5)
    assert np.array_equal(near[..., MEDIAN] > 0, far[..., MEDIAN] > 0)


def test_a_gradient_of_the_depth_moves_the_centers_as_if_the_skin_moved_along() -> None:
    # One opaque splat: its depth is that of its skin, which follows the center along the optical axis.
    gaussians = one(0.95, (0.1, 0.1, 0.1))
    renderer = drawn(gaussians, "skin")
    weights = (renderer.depth.to_numpy()[..., EXPECTED] > 0).astype(np.float32)
    renderer.adj_image.assign(np.zeros((48, 64, 3), np.float32))
    renderer.adj_transmittance.assign(np.zeros((48, 64, 1), np.float32))
    renderer.adj_depth.assign(weights[..., None])
    renderer.backward()
    expected = weights.sum() * CAMERA.world_from_cam[:3, 2]
    assert renderer.gradients.means.numpy()[0] == pytest.approx(expected, rel=1e-3)
    assert np.abs(renderer.gradients.opacity_logits.numpy()).max() < 1e-3 * weights.sum()


def test_a_huge_splat_has_its_skin_in_front_of_the_camera() -> None:
    depth = drawn(one(0.99, (30.0, 30.0, 30.0)), "skin").depth.to_numpy()[..., EXPECTED]
    assert np.all(np.isfinite(depth))
    assert depth.max() > 0


def test_the_median_counts_between_two_surfaces_and_nothing_without_one() -> None:
    channels = np.array([[0.0, 0.0], [1.0, 0.0], [1.001, 1.0], [1.2, 1.0]], np.float32)
    np.testing.assert_array_equal(
        surface_depth(channels), np.array([np.nan, np.nan, 1.001, 1.0], np.float32)
    )
