"""Gradients of one rendered view as NumPy arrays: those of the renderer, whatever the outputs."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.geometry.camera import Camera
from digs_warp.splat.camera_gradient import (
    camera_gradient,
    moved_camera,
    pose_gradient,
    rotation_jacobian,
)
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.render import SplatRenderer, render
from reference.fresh_process import run_fresh
from reference.splat_scenes import NEAR, camera, random_gaussians

ALL = RasterOptions(outputs="depth")
SCENE = random_gaussians(12, seed=4)
VIEW = camera(33, 27)


def check_same(found: Gaussians, wanted: Gaussians) -> None:
    for name in FIELDS:
        assert getattr(found, name).shape == getattr(SCENE, name).shape
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name), err_msg=name)


def test_adjoints_of_all_outputs_go_to_the_renderer() -> None:
    rng = np.random.default_rng(0)
    given = {name: rng.normal(size=(27, 33)) for name in ("adj_alpha", "adj_depth")}
    given["adj_image"] = rng.normal(size=(27, 33, 3))
    view = render(SCENE, VIEW, near=NEAR, options=ALL)
    found, again = view.backward(**given), view.backward(**given)
    check_same(again, found)
    renderer = SplatRenderer(DeviceGaussians.from_numpy(SCENE), 33, 27, options=ALL)
    renderer.forward(VIEW, near=NEAR)
    renderer.adj_image.assign(given["adj_image"])
    renderer.adj_transmittance.assign(-given["adj_alpha"])
    assert view.depth is not None
    renderer.adj_depth.assign(np.where(np.isnan(view.depth), 0.0, given["adj_depth"]))
    renderer.backward()
    check_same(found, renderer.gradients.to_numpy())


def test_outputs_without_an_adjoint_count_nothing() -> None:
    view = render(SCENE, VIEW, near=NEAR, options=ALL)
    adjoint = np.ones((27, 33))
    alone = view.backward(adj_alpha=adjoint)
    beside = view.backward(
        adj_image=np.zeros((27, 33, 3)), adj_alpha=adjoint, adj_depth=np.zeros((27, 33))
    )
    check_same(alone, beside)
    nothing = view.backward()
    assert not any(getattr(nothing, name).any() for name in FIELDS)


def test_pixels_without_depth_have_no_gradient() -> None:
    far = Gaussians(*(getattr(SCENE, name)[:1] for name in FIELDS))
    view = render(far, VIEW, near=NEAR, options=RasterOptions(outputs="depth"))
    assert view.depth is not None and np.isnan(view.depth).any()
    adjoint = np.where(np.isnan(view.depth), np.nan, 1.0)
    gradients = view.backward(adj_depth=adjoint)
    assert np.isfinite(gradients.means).all() and gradients.means.any()


def test_wrong_adjoints_are_named() -> None:
    view = render(SCENE, VIEW, near=NEAR)
    with pytest.raises(DigsError, match=r"adj_image: shape \(5, 5, 3\)"):
        view.backward(adj_image=np.zeros((5, 5, 3)))
    with pytest.raises(DigsError, match=r"adj_alpha: .*NaN"):
        view.backward(adj_alpha=np.full((27, 33), np.nan))
    with pytest.raises(DigsError, match=r"adj_depth: the view has no such output.*outputs"):
        view.backward(adj_depth=np.zeros((27, 33)))


def test_the_jacobian_of_a_rotation_vector() -> None:
    for vector in (np.zeros(3), np.array([3e-5, 0, -2e-5]), np.array([0.4, -1.1, 0.7])):
        start = Rotation.from_rotvec(vector)
        for axis in range(3):
            step = 1e-6 * np.eye(3)[axis]
            change = (start.inv() * Rotation.from_rotvec(vector + step)).as_rotvec() / 1e-6
            np.testing.assert_allclose(rotation_jacobian(vector)[:, axis], change, atol=1e-5)


def test_the_gradient_in_a_pose_is_that_of_its_camera() -> None:
    weights = np.random.default_rng(1).normal(size=(3, 4))
    pose = np.array([0.5, -0.8, 0.3, 0.1, 0.2, -0.3])

    def slopes(view: Camera, at: np.ndarray) -> np.ndarray:
        steps = 1e-5 * np.array([np.eye(6), -np.eye(6)])
        poses = [
            [moved_camera(view, at + step).world_from_cam[:3] for step in way] for way in steps
        ]
        ahead, back = (np.asarray(each) for each in poses)
        return ((ahead - back) * weights).sum(axis=(1, 2)) / 2e-5

    found = pose_gradient(slopes(moved_camera(VIEW, pose), np.zeros(6)), pose)
    np.testing.assert_allclose(found, slopes(VIEW, pose), atol=1e-8)


def test_a_wrong_pose_finds_back() -> None:
    """Also from a start far from zero, where the rotation vector's own Jacobian counts."""
    truth = np.array([0.15, -0.2, 0.1, 0.02, -0.01, 0.03])
    start = truth + np.array([0.02, -0.015, 0.02, 0.01, 0.008, -0.01])
    target = render(SCENE, moved_camera(VIEW, truth), near=NEAR).image
    pose = start.copy()
    # Adam: rotation and translation have different units.
    first, second = np.zeros(6), np.zeros(6)
    for step in range(1, 141):
        view = render(SCENE, moved_camera(VIEW, pose), near=NEAR)
        found = view.backward(adj_image=2 * (view.image - target))
        gradient = pose_gradient(camera_gradient(SCENE, found, moved_camera(VIEW, pose)), pose)
        first = 0.8 * first + 0.2 * gradient
        second = 0.95 * second + 0.05 * gradient**2
        scale = np.sqrt(second / (1 - 0.95**step)) + 1e-12
        pose -= 3e-3 * 0.97**step * first / (1 - 0.8**step) / scale
    assert np.abs(pose - truth).max() < 0.1 * np.abs(start - truth).max()


def test_the_example_of_the_page_runs() -> None:
    page = Path(__file__).parents[3] / "docs/research/rasterizer.md"
    example = page.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    assert float(run_fresh(example).stdout.split()[-1]) == pytest.approx(1.0, abs=1e-4)
