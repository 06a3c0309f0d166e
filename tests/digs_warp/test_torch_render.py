# torch is an extra that type checking need not have:
# pyright: reportMissingImports=false, reportOptionalMemberAccess=false
"""Rendering under autograd, where PyTorch is installed: the gradients of `render`."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import read_capture
from digs_warp.data.gaussians import FIELDS
from digs_warp.splat.camera_gradient import camera_gradient, moved_camera, pose_gradient
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.render import render as render_numpy
from reference.splat_scenes import BACKGROUND, NEAR, camera, random_gaussians

torch = pytest.importorskip("torch", reason="torch is not installed")
from digs_warp.torch import CaptureDataset, TorchView, render  # noqa: E402 (after the check for torch)

ALL = RasterOptions(outputs="depth")
SCENE = random_gaussians(12, seed=4)
VIEW = camera(33, 27)
BEHIND = (BACKGROUND[0], BACKGROUND[1], BACKGROUND[2])


def tensors(dtype: Any = torch.float32) -> list[Any]:
    return [torch.tensor(getattr(SCENE, name), dtype=dtype, requires_grad=True) for name in FIELDS]


def test_the_view_is_that_of_render() -> None:
    view = render(*tensors(), camera=VIEW, near=NEAR, background=BEHIND, options=ALL)
    wanted = render_numpy(SCENE, VIEW, near=NEAR, background=BEHIND, options=ALL)
    for name in TorchView._fields:
        np.testing.assert_array_equal(getattr(view, name).detach(), getattr(wanted, name))
    plain = render(*tensors(), camera=VIEW)
    assert plain.depth is None


def test_several_cameras_are_a_batch() -> None:
    cameras = [VIEW, VIEW.shifted_right(0.1), VIEW.shifted_right(-0.1)]
    poses = torch.zeros(3, 6, requires_grad=True)
    inputs = tensors()
    views = render(*inputs, camera=cameras, pose=poses, near=NEAR, options=ALL)
    assert views.depth.shape == (3, 27, 33)
    for number, each in enumerate(cameras):
        alone = render(*tensors(), camera=each, near=NEAR).image
        np.testing.assert_array_equal(views.image[number].detach(), alone.detach())
    views.image[1].sum().backward()
    assert poses.grad[1].abs().min() > 0 and not poses.grad[[0, 2]].any()
    assert all(tensor.grad is not None for tensor in inputs)
    assert render(*inputs, camera=cameras).depth is None


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_gradients_are_those_of_render(dtype: Any) -> None:
    rng = np.random.default_rng(0)
    weights = rng.normal(size=(27, 33, 3)), *rng.normal(size=(2, 27, 33))
    pose = torch.tensor([0.02, -0.03, 0.02, 0.01, -0.01, 0.02], dtype=dtype, requires_grad=True)
    inputs = tensors(dtype)
    view = render(*inputs, camera=VIEW, pose=pose, near=NEAR, options=ALL)
    layers = view.image, view.alpha, view.depth
    terms = [(x * torch.tensor(w)).sum() for x, w in zip(layers, weights, strict=True)]
    torch.stack(terms).sum().backward()
    moved = pose.detach().double().numpy()
    there = moved_camera(VIEW, moved)
    plain = render_numpy(SCENE, there, near=NEAR, options=ALL)
    image, alpha, depth = weights
    wanted = plain.backward(adj_image=image, adj_alpha=alpha, adj_depth=depth)
    for name, tensor in zip(FIELDS, inputs, strict=True):
        assert tensor.grad.dtype == dtype
        np.testing.assert_allclose(tensor.grad, getattr(wanted, name), rtol=1e-5, atol=1e-6)
    of_pose = pose_gradient(camera_gradient(SCENE, wanted, there), moved)
    np.testing.assert_allclose(pose.grad, of_pose, rtol=1e-5)


@pytest.mark.parametrize("workers", [0, 2])
def test_a_recording_is_a_data_set(capture_folder: Path, workers: int) -> None:
    capture = read_capture(capture_folder)
    loader = torch.utils.data.DataLoader(CaptureDataset(capture), 2, num_workers=workers)
    names = ("name", "image", "depth")
    items = [item for batch in loader for item in zip(*map(batch.get, names), strict=True)]
    for frame, (name, image, depth) in zip(capture.frames, items, strict=True):
        assert name == frame.name
        np.testing.assert_array_equal(image, frame.load_image() / np.float32(255))
        np.testing.assert_array_equal(depth, frame.load_depth())
    first = CaptureDataset(capture, capture.split()[1])[0]
    np.testing.assert_allclose(first["K"], capture.frames[0].camera.intrinsics.matrix, rtol=1e-6)
    assert set(first) >= {"mask", "world_from_cam"} and first["mask"].max() == 1


def test_a_wrong_shape_is_named() -> None:
    with pytest.raises(DigsError, match="pose"):
        render(*tensors(), camera=VIEW, pose=torch.zeros(3))
    means, log_scales, quats, opacity_logits, sh = tensors()
    with pytest.raises(DigsError, match=r"Gaussians\.quats"):
        render(means, log_scales, quats[:, :3], opacity_logits, sh, VIEW)
