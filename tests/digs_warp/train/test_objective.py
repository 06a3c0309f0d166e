"""The logged loss is the one that is optimized: its slopes are the gradients that the optimizer sees."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.losses.depth import DepthTarget
from digs_warp.splat.blur_renderer import BlurRenderer
from digs_warp.splat.camera_motion import Blur, RowMotion
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.config import Density, TrainConfig
from digs_warp.train.objective import Objective
from digs_warp.train.views import packed_view
from reference.splat_scenes import random_gaussians

EXTENT = 1.7
POSE = look_at(np.array([0.0, -3.0, 0.5]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
CAMERA = Camera(Intrinsics.from_fov(64, 48, 60.0), POSE)
MCMC = TrainConfig(density=Density(strategy="mcmc"))


def compared(unknown: np.ndarray | None, image: np.ndarray, mask: np.ndarray) -> Objective:
    """Return the objective after a comparison, and its gradients."""
    view = packed_view("0", CAMERA, image, mask, unknown=unknown)
    splats = DeviceGaussians.from_numpy(random_gaussians(40, seed=1))
    renderer = BlurRenderer(splats, 64, 48, options=RasterOptions())
    objective = Objective(renderer, MCMC, EXTENT)
    renderer.forward(CAMERA, near=0.01, background=np.ones(3))
    objective.compare(view, np.ones(3))
    return objective


def loss_and_slope(gaussians: Gaussians, config: TrainConfig) -> tuple[float, np.ndarray]:
    """Return the logged loss, and dL/d(opacity logit), shape (n,)."""
    image = np.random.default_rng(0).integers(0, 256, (48, 64, 3), dtype=np.uint8)
    view = packed_view("0", CAMERA, image, np.full((48, 64), 255, np.uint8))
    renderer = BlurRenderer(DeviceGaussians.from_numpy(gaussians), 64, 48, options=RasterOptions())
    objective = Objective(renderer, config, EXTENT)
    renderer.forward(CAMERA, near=0.01, background=np.ones(3))
    objective.compare(view, np.ones(3))
    objective.pull_back()
    return objective.value(), renderer.gradients.opacity_logits.numpy().copy()


def test_the_logged_loss_holds_the_regularizers() -> None:
    gaussians = random_gaussians(40, seed=1)
    without = loss_and_slope(gaussians, replace(MCMC, opacity_weight=0.0, scale_weight=0.0))[0]
    expected = 0.01 * gaussians.opacities.mean() + 0.01 * gaussians.scales.mean() / EXTENT
    assert loss_and_slope(gaussians, MCMC)[0] - without == pytest.approx(expected, rel=1e-4)


def test_slopes_of_the_logged_loss_are_the_gradients() -> None:
    """A Gaussian behind the camera is seen by no view: only the regularizer moves it."""
    gaussians = random_gaussians(40, seed=1)
    gaussians.means[0] = [0.0, -9.0, 0.0]
    strong = replace(MCMC, opacity_weight=1.0)
    _, slope = loss_and_slope(gaussians, strong)
    moved = []
    for step in (-0.05, 0.05):
        logits = gaussians.opacity_logits.copy()
        logits[0] += step
        moved.append(loss_and_slope(replace(gaussians, opacity_logits=logits), strong)[0])
    assert slope[0] > 1e-3
    assert (moved[1] - moved[0]) / 0.1 == pytest.approx(slope[0], rel=1e-2)


def test_it_goes_on_with_other_gaussians() -> None:
    renderer = BlurRenderer(DeviceGaussians.from_numpy(random_gaussians(9, seed=1)), 64, 48)
    objective = Objective(renderer, MCMC, EXTENT)
    renderer.set_gaussians(DeviceGaussians.from_numpy(random_gaussians(20, seed=2)))
    objective.rebind()
    assert [len(term.sums) for term in objective._other_terms] == [20]


def test_unknown_pixels_are_not_judged() -> None:
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (48, 64, 3), dtype=np.uint8)
    mask = np.where(np.arange(64) < 40, 255, 0).astype(np.uint8) * np.ones((48, 1), np.uint8)
    unknown = np.zeros((48, 64), bool)
    unknown[10:40, 30:60] = True  # inside and outside of the mask
    other_image, other_mask = image.copy(), mask.copy()
    other_image[unknown] = rng.integers(0, 256, (unknown.sum(), 3))
    other_mask[unknown] = 255 - other_mask[unknown]

    one = compared(unknown, image, mask)
    two = compared(unknown, other_image, other_mask)
    assert one.value() == two.value()
    here, there = (each._renderer.adj_image.to_numpy() for each in (one, two))
    np.testing.assert_array_equal(here, there)
    assert not here[unknown].any()
    assert here[~unknown].any()

    # Known pixels are judged as if the photograph showed there what was rendered.
    plain = compared(None, image, mask)
    known = ~unknown
    far = known.copy()
    far[:, 19:] = False  # beyond the windows of SSIM
    np.testing.assert_array_equal(
        one._renderer.adj_image.to_numpy()[far], plain._renderer.adj_image.to_numpy()[far]
    )
    assert one.value() < plain.value()


@pytest.mark.parametrize("moments", [1, 2, 3])
def test_slopes_are_the_gradients_where_a_blurred_view_has_depth(moments: int) -> None:
    """The image is a mean over moments, the depth that of one: their terms are weighed as in the loss."""
    gaussians = random_gaussians(40, seed=1)
    image = np.random.default_rng(0).integers(0, 256, (48, 64, 3), dtype=np.uint8)
    view = packed_view("0", CAMERA, image, np.full((48, 64), 255, np.uint8))
    measured = wp.array(np.full(48 * 64, 2.9, np.float32))
    trusted = wp.array(np.full(48 * 64, 255, np.uint8), dtype=wp.uint8)
    view = replace(view, depth=DepthTarget(measured, trusted, 48.0 * 64.0))
    blur = Blur(RowMotion(np.array([0.02, 0.03, 0.0]), np.zeros(3)), moments - 0.6)
    assert blur.moments == moments

    def loss_and_slopes(logits: np.ndarray) -> tuple[float, np.ndarray]:
        splats = DeviceGaussians.from_numpy(replace(gaussians, opacity_logits=logits))
        options = RasterOptions(outputs="depth")
        renderer = BlurRenderer(splats, 64, 48, options=options, moments=3)
        objective = Objective(renderer, TrainConfig(), EXTENT, depth_weight=1.0)
        renderer.forward(CAMERA, near=0.01, background=np.ones(3), blur=blur)
        objective.compare(view, np.ones(3))
        objective.pull_back()
        return objective.value(), renderer.gradients.opacity_logits.numpy().copy()

    start = gaussians.opacity_logits
    _, slopes = loss_and_slopes(start)
    direction = np.where(slopes > 0, 1, -1).astype(np.float32)
    up, down = (loss_and_slopes(start + step * direction)[0] for step in (1e-2, -1e-2))
    assert (up - down) / 2e-2 == pytest.approx(np.abs(slopes).sum(), rel=0.05)
