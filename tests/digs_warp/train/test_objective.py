"""The logged loss is the one that is optimized: its slopes are the gradients that the optimizer sees."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.losses.depth import DepthTarget
from digs_warp.splat.blur_renderer import BlurRenderer
from digs_warp.splat.camera_motion import Blur, RowMotion
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.objective import Objective
from digs_warp.train.views import View, packed_view
from reference.splat_scenes import random_gaussians

POSE = look_at(np.array([0.0, -3.0, 0.5]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
CAMERA = Camera(Intrinsics.from_fov(64, 48, 60.0), POSE)


IMAGE = np.random.default_rng(0).integers(0, 256, (48, 64, 3), dtype=np.uint8)
PLAIN = packed_view("0", CAMERA, IMAGE, np.full((48, 64), 255, np.uint8))


def with_depth() -> View:
    """The plain view, 2.9 m away."""
    measured = wp.array(np.full(48 * 64, 2.9, np.float32))
    trusted = wp.array(np.full(48 * 64, 255, np.uint8), dtype=wp.uint8)
    return replace(PLAIN, depth=DepthTarget(measured, trusted, 48.0 * 64.0))


def compared(unknown: np.ndarray | None, image: np.ndarray, mask: np.ndarray) -> Objective:
    """Return the objective after a comparison, and its gradients."""
    view = packed_view("0", CAMERA, image, mask, unknown=unknown)
    splats = DeviceGaussians.from_numpy(random_gaussians(40, seed=1))
    renderer = BlurRenderer(splats, 64, 48, options=RasterOptions())
    objective = Objective(renderer)
    renderer.forward(CAMERA, near=0.01, background=np.ones(3))
    objective.compare(view, np.ones(3))
    return objective


def test_unknown_pixels_are_not_judged() -> None:
    rng = np.random.default_rng(0)
    image = IMAGE
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


@pytest.mark.parametrize("moments", [1, 3])
def test_slopes_are_the_gradients_where_a_blurred_view_has_depth(moments: int) -> None:
    """The image is a mean over moments, the depth that of one: their terms are weighed as in the loss."""
    gaussians = random_gaussians(40, seed=1)
    view = with_depth()
    blur = Blur(RowMotion(np.array([0.02, 0.03, 0.0]), np.zeros(3)), moments - 0.6)
    assert blur.moments == moments

    def loss_and_slopes(logits: np.ndarray) -> tuple[float, np.ndarray]:
        splats = DeviceGaussians.from_numpy(replace(gaussians, opacity_logits=logits))
        options = RasterOptions(outputs="depth")
        renderer = BlurRenderer(splats, 64, 48, options=options, moments=3)
        objective = Objective(renderer, depth_weight=1.0)
        renderer.forward(CAMERA, near=0.01, background=np.ones(3), blur=blur)
        objective.compare(view, np.ones(3))
        renderer.backward()
        return objective.value(), renderer.gradients.opacity_logits.numpy().copy()

    start = gaussians.opacity_logits
    _, slopes = loss_and_slopes(start)
    direction = np.where(slopes > 0, 1, -1).astype(np.float32)
    up, down = (loss_and_slopes(start + step * direction)[0] for step in (1e-2, -1e-2))
    assert (up - down) / 2e-2 == pytest.approx(np.abs(slopes).sum(), rel=0.05)


def test_a_view_without_depth_finds_nothing_of_the_one_before() -> None:
    splats = DeviceGaussians.from_numpy(random_gaussians(40, seed=1))
    renderer = BlurRenderer(splats, 64, 48, options=RasterOptions(outputs="mean depth"))
    objective = Objective(renderer, depth_weight=1.0)
    renderer.forward(CAMERA, near=0.01, background=np.ones(3))
    values = []
    for view in (PLAIN, with_depth(), PLAIN):
        objective.compare(view, np.ones(3))
        values.append(objective.value())
    assert values[0] == values[2] < values[1]
    assert not renderer.middle.adj_depth.to_numpy().any()
