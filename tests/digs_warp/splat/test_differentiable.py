# Warp types its kernel language only in part:
# pyright: reportOperatorIssue=false, reportIndexIssue=false, reportArgumentType=false
# pyright: reportOptionalMemberAccess=false, reportCallIssue=false, reportGeneralTypeIssues=false
"""Rasterization on a tape: gradients of a caller's own loss, and optimizations that reach their target."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from scipy.spatial.transform import Rotation

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.splat.camera_motion import rotation_jacobian
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.differentiable import RasterizedView, rasterize
from digs_warp.splat.render import SplatRenderer, render
from reference.splat_scenes import BACKGROUND, NEAR, camera, random_gaussians

SCENE = random_gaussians(12, seed=4)
VIEW = camera(33, 27)
ALL = RasterOptions(outputs="normals")


@wp.kernel
def squared_error(
    values: wp.array3d[float],
    target: wp.array3d[float],
    weight: float,
    loss: wp.array[float],
):
    y, x, channel = wp.tid()  # pyright: ignore
    error = values[y, x, channel] - target[y, x, channel]
    wp.atomic_add(loss, 0, weight * error * error)


def pose_array(values: list[float] | np.ndarray) -> wp.array:
    return wp.array(np.asarray(values), dtype=float, device="cpu", requires_grad=True)


def on_device(gaussians: Gaussians) -> DeviceGaussians:
    return DeviceGaussians.from_numpy(gaussians, requires_grad=True)


def loss_of(
    tape: wp.Tape, views: list[RasterizedView], targets: list[np.ndarray], names: tuple[str, ...]
) -> wp.array:
    """Sum of squared errors of some outputs, launched on the tape."""
    loss = wp.zeros(1, dtype=float, device="cpu", requires_grad=True)
    for view in views:
        for name, target in zip(names, targets, strict=True):
            values = getattr(view, name)
            wanted = wp.array(target, dtype=float, device="cpu")
            inputs = [values, wanted, 1.0, loss]
            wp.launch(squared_error, dim=values.shape, inputs=inputs, device="cpu")
    return loss


def test_the_tape_gives_the_gradients_of_the_renderer() -> None:
    names = ("image", "alpha", "depth", "normals")
    gaussians = on_device(SCENE)
    pose, intrinsics = pose_array(np.zeros(6)), pose_array([40.0, 38.0, 17.0, 12.0])
    with wp.Tape() as tape:
        view = rasterize(
            tape,
            gaussians,
            VIEW,
            pose=pose,
            intrinsics=intrinsics,
            near=NEAR,
            background=BACKGROUND,
            options=ALL,
        )
        targets = [np.full(getattr(view, name).shape, 0.3) for name in names]
        loss = loss_of(tape, [view], targets, names)
    tape.backward(loss)

    k = VIEW.intrinsics
    renderer = SplatRenderer(
        DeviceGaussians.from_numpy(SCENE), k.width, k.height, options=ALL, camera_gradient=True
    )
    other = type(VIEW)(type(k)(k.width, k.height, 40.0, 38.0, 17.0, 12.0), VIEW.world_from_cam)
    renderer.forward(other, near=NEAR, background=BACKGROUND)
    np.testing.assert_array_equal(view.image.numpy(), renderer.image.to_numpy())
    alpha = 1 - renderer.transmittance.to_numpy()
    np.testing.assert_array_equal(view.alpha.numpy(), alpha)
    renderer.adj_image.assign(2 * (renderer.image.to_numpy() - 0.3))
    renderer.adj_transmittance.assign(-2 * (alpha - 0.3))
    renderer.adj_depth.assign(2 * (renderer.depth.to_numpy()[..., :1] - 0.3))
    renderer.adj_normals.assign(2 * (renderer.normals.to_numpy() - 0.3))
    renderer.backward()
    for array, gradient in zip(gaussians.arrays, renderer.gradients.arrays, strict=True):
        wanted = gradient.numpy()
        np.testing.assert_allclose(array.grad.numpy(), wanted, atol=1e-5 * np.abs(wanted).max())
    motion = renderer.camera_gradient()
    wanted = np.concatenate([motion.rotation, motion.translation])
    np.testing.assert_allclose(pose.grad.numpy(), wanted, rtol=1e-4)
    wanted = np.concatenate([motion.focal, motion.center])
    np.testing.assert_allclose(intrinsics.grad.numpy(), wanted, rtol=1e-4)


def test_gradients_of_several_views_add_up_and_zero_clears_them() -> None:
    def gradient(count: int) -> tuple[wp.Tape, DeviceGaussians]:
        gaussians = on_device(SCENE)
        with wp.Tape() as tape:
            views = [rasterize(tape, gaussians, VIEW, near=NEAR) for _ in range(count)]
            loss = loss_of(tape, views, [np.zeros((27, 33, 3))], ("image",))
        tape.backward(loss)
        return tape, gaussians

    _, once = gradient(1)
    tape, twice = gradient(2)
    for a, b in zip(once.arrays, twice.arrays, strict=True):
        np.testing.assert_allclose(2 * a.grad.numpy(), b.grad.numpy(), rtol=1e-5, atol=1e-7)
    tape.zero()
    assert not any(array.grad.numpy().any() for array in twice.arrays)


def test_arrays_without_gradients_are_inputs_all_the_same() -> None:
    gaussians = DeviceGaussians.from_numpy(SCENE)
    gaussians.sh.requires_grad = True
    with wp.Tape() as tape:
        view = rasterize(tape, gaussians, VIEW, near=NEAR)
        loss = loss_of(tape, [view], [np.zeros((27, 33, 3))], ("image",))
    tape.backward(loss)
    assert gaussians.sh.grad.numpy().any()
    assert gaussians.means.grad is None


def test_without_a_tape_the_view_is_that_of_render() -> None:
    behind = np.random.default_rng(0).uniform(size=(27, 33, 3)).astype(np.float32)
    view = rasterize(None, DeviceGaussians.from_numpy(SCENE), VIEW, background=behind, options=ALL)
    wanted = render(SCENE, VIEW, background=behind, options=ALL)
    np.testing.assert_array_equal(view.image.numpy(), wanted.image)
    np.testing.assert_array_equal(view.alpha.numpy()[..., 0], wanted.alpha)
    np.testing.assert_array_equal(view.normals.numpy(), wanted.normals)
    for found, depth in ((view.depth, wanted.depth), (view.median_depth, wanted.median_depth)):
        np.testing.assert_array_equal(found.numpy()[..., 0], np.nan_to_num(depth))


def test_a_wrong_pose_finds_back() -> None:
    """Also a start far from zero, where the rotation vector's own Jacobian counts."""
    truth = np.array([0.15, -0.2, 0.1, 0.02, -0.01, 0.03])
    start = truth + np.array([0.02, -0.015, 0.02, 0.01, 0.008, -0.01])
    gaussians = DeviceGaussians.from_numpy(SCENE)
    target = rasterize(None, gaussians, VIEW, pose=pose_array(truth), near=NEAR).image.numpy()
    pose = start.copy()
    # Adam: rotation and translation have different units.
    first, second = np.zeros(6), np.zeros(6)
    for step in range(1, 141):
        array = pose_array(pose)
        with wp.Tape() as tape:
            view = rasterize(tape, gaussians, VIEW, pose=array, near=NEAR)
            loss = loss_of(tape, [view], [target], ("image",))
        tape.backward(loss)
        gradient = array.grad.numpy().astype(np.float64)
        first = 0.8 * first + 0.2 * gradient
        second = 0.95 * second + 0.05 * gradient**2
        scale = np.sqrt(second / (1 - 0.95**step)) + 1e-12
        pose -= 3e-3 * 0.97**step * first / (1 - 0.8**step) / scale
    assert np.abs(pose - truth).max() < 0.1 * np.abs(start - truth).max()


def test_the_jacobian_of_a_rotation_vector() -> None:
    for vector in (np.zeros(3), np.array([3e-5, 0, -2e-5]), np.array([0.4, -1.1, 0.7])):
        start = Rotation.from_rotvec(vector)
        for axis in range(3):
            step = 1e-6 * np.eye(3)[axis]
            change = (start.inv() * Rotation.from_rotvec(vector + step)).as_rotvec() / 1e-6
            np.testing.assert_allclose(rotation_jacobian(vector)[:, axis], change, atol=1e-5)


@pytest.mark.parametrize("name", FIELDS)
def test_a_scene_finds_back_through_the_tape(name: str) -> None:
    """Plain gradient descent on one kind of parameter takes the error down ten times."""
    truth = DeviceGaussians.from_numpy(SCENE)
    target = rasterize(None, truth, VIEW, near=NEAR).image.numpy()
    rng = np.random.default_rng(1)
    wrong = {field: getattr(SCENE, field).copy() for field in FIELDS}
    wrong[name] += 0.03 * rng.normal(size=wrong[name].shape).astype(np.float32)
    gaussians = on_device(Gaussians(**wrong))
    parameter = getattr(gaussians, name)
    losses, moment = [], np.zeros(parameter.numpy().shape)
    for _ in range(40):
        with wp.Tape() as tape:
            view = rasterize(tape, gaussians, VIEW, near=NEAR)
            loss = loss_of(tape, [view], [target], ("image",))
        tape.backward(loss)
        losses.append(float(loss.numpy()[0]))
        gradient = parameter.grad.numpy()
        moment = 0.9 * moment + 0.1 * gradient**2
        parameter.assign(parameter.numpy() - 2e-3 * gradient / (np.sqrt(moment) + 1e-8))
        tape.zero()
    assert losses[-1] < 0.1 * losses[0]


def test_the_example_of_the_page_runs(tmp_path: Path) -> None:
    page = (Path(__file__).parents[3] / "docs" / "rasterizer.md").read_text(encoding="utf-8")
    example = tmp_path / "example.py"
    example.write_text(page.split("```python\n")[1].split("```")[0], encoding="utf-8")
    done = subprocess.run(
        [sys.executable, str(example)], check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    depth = float(done.stdout.split()[-1])
    assert depth == pytest.approx(1.0, abs=1e-4)


def test_arrays_of_the_wrong_shape_are_refused() -> None:
    gaussians = DeviceGaussians.from_numpy(SCENE)
    with pytest.raises(DigsError, match=r"pose.*\(6\)"):
        rasterize(None, gaussians, VIEW, pose=pose_array(np.zeros(7)))
    with pytest.raises(DigsError, match=r"intrinsics.*\(4\)"):
        rasterize(None, gaussians, VIEW, intrinsics=pose_array(np.zeros(3)))
    with pytest.raises(DigsError, match="focal"):
        rasterize(None, gaussians, VIEW, intrinsics=pose_array([0.0, 1.0, 1.0, 1.0]))
    with pytest.raises(DigsError, match="background"):
        rasterize(None, gaussians, VIEW, background=np.zeros((27, 32, 3)))
