# torch is an extra that type checking need not have:
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false
"""PyTorch: `digs_warp.render` under `torch.autograd`, and recordings as data sets.

    import digs_warp.torch

    view = digs_warp.torch.render(means, log_scales, quats, opacity_logits, sh, camera)
    ((view.image - target) ** 2).mean().backward()

    loader = torch.utils.data.DataLoader(digs_warp.torch.CaptureDataset(capture), num_workers=2)

The kernels compute in float32 on the CPU; tensors of other types and devices are converted, and so are
their gradients. Gradients of gradients are not available.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

try:
    import torch
except ModuleNotFoundError as error:
    raise ModuleNotFoundError("digs_warp.torch needs PyTorch: pip install torch") from error

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.data.layers import Layer
from digs_warp.geometry.camera import Camera
from digs_warp.splat.camera_gradient import camera_gradient, moved_camera, pose_gradient
from digs_warp.splat.config import DEFAULT_OPTIONS, RasterOptions
from digs_warp.splat.render import render as render_numpy
from digs_warp.splat.renderer import WHITE

__all__ = ["CaptureDataset", "TorchView", "render"]


class TorchView(NamedTuple):
    """A rendered view; see `digs_warp.splat.render.RenderOutput`. Of several cameras, (cameras, height, ...).

    Attributes:
        image: sRGB, shape (height, width, 3).
        alpha: coverage in 0..1, shape (height, width).
        depth: expected planar depth [m], NaN where nothing is drawn, (height, width); None unless asked for.
    """

    image: torch.Tensor
    alpha: torch.Tensor
    depth: torch.Tensor | None


def render(
    means: torch.Tensor,
    log_scales: torch.Tensor,
    quats: torch.Tensor,
    opacity_logits: torch.Tensor,
    sh: torch.Tensor,
    camera: Camera | Sequence[Camera],
    *,
    pose: torch.Tensor | None = None,
    near: float | None = None,
    background: tuple[float, float, float] = WHITE,
    options: RasterOptions = DEFAULT_OPTIONS,
) -> TorchView:
    """Render one view of Gaussians, or one for each of several cameras.

    Args:
        means: centers [m], shape (n, 3); this and the next four as in `digs_warp.data.gaussians.Gaussians`.
        log_scales: shape (n, 3).
        quats: xyzw, shape (n, 4).
        opacity_logits: shape (n,).
        sh: shape (n, K, 3).
        camera: from where; several need images of one size.
        pose: a motion of the camera to optimize, shape (6,), see `moved_camera`; of several, (cameras, 6).
        near: near plane [m]; default: a share of the distance to the middle of the Gaussians.
        background: sRGB color behind the Gaussians; a constant.
        options: how splats are drawn, and whether depth is wanted. Tensors do not say what they
            are made for: scenes of 3D Gaussian splatting want a dilation of 0.3.

    Raises:
        DigsError: tensors of other shapes, or values that are not finite.
    """
    parameters = means, log_scales, quats, opacity_logits, sh
    settings = {"near": near, "background": background, "options": options}
    if isinstance(camera, Camera):
        return TorchView(*_Render.apply(settings | {"camera": camera}, pose, *parameters))
    poses = [None] * len(camera) if pose is None else pose
    views = [
        _Render.apply(settings | {"camera": each}, motion, *parameters)
        for each, motion in zip(camera, poses, strict=True)
    ]
    layers = zip(*views, strict=True)
    return TorchView(*(None if each[0] is None else torch.stack(each) for each in layers))


class CaptureDataset(torch.utils.data.Dataset):
    """The frames of a recording as tensors, for a `DataLoader` with any number of workers.

    An item is a dictionary of what all frames have: ``image`` (height, width, 3) in 0..1, ``depth`` [m] with
    NaN where unknown, ``mask`` and ``confidence`` in 0..1, (height, width), ``K`` (3, 3) with the first pixel
    center at (0.5, 0.5), ``world_from_cam`` (4, 4), OpenCV axes; all float32; ``name`` is text. Frames of one
    size can be stacked to batches.

    Args:
        capture: a recording.
        frames: of it, such as the first of `Capture.split`; None: all.
    """

    def __init__(self, capture: Capture, frames: Sequence[Frame] | None = None) -> None:
        self.frames = tuple(capture.frames if frames is None else frames)
        load = {
            Layer.DEPTH: Frame.load_depth,
            Layer.MASK: Frame.load_mask,
            Layer.CONFIDENCE: Frame.load_confidence,
        }
        self._load = {
            layer: loader
            for layer, loader in load.items()
            if all(frame.has(layer) for frame in self.frames)
        }

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, index: int) -> dict[str, Any]:
        frame = self.frames[index]
        layers = {"image": frame.load_image()}
        layers |= {layer.name.lower(): load(frame) for layer, load in self._load.items()}
        scaled = {
            name: pixels / np.float32(255) if pixels.dtype == np.uint8 else pixels
            for name, pixels in layers.items()
        }
        camera = {
            "K": frame.camera.intrinsics.matrix,
            "world_from_cam": frame.camera.world_from_cam,
        }
        tensors = {
            name: torch.from_numpy(np.float32(each)) for name, each in (scaled | camera).items()
        }
        return {"name": frame.name, **tensors}


class _Render(torch.autograd.Function):
    """The connection between autograd and the NumPy adjoints of a view."""

    @staticmethod
    def forward(
        ctx: Any, settings: dict[str, Any], pose: torch.Tensor | None, *parameters: torch.Tensor
    ) -> tuple[torch.Tensor | None, ...]:
        ctx.set_materialize_grads(False)
        ctx.inputs, ctx.pose, ctx.camera = (pose, *parameters), None, settings["camera"]
        if pose is not None:
            ctx.pose = pose.detach().cpu().double().numpy()
            ctx.camera = moved_camera(ctx.camera, ctx.pose)
        arrays = (tensor.detach().cpu().float().numpy() for tensor in parameters)
        ctx.gaussians = Gaussians(*arrays)
        moved: dict[str, Any] = settings | {"camera": ctx.camera}
        ctx.view = view = render_numpy(ctx.gaussians, **moved)
        outputs = view.image, view.alpha, view.depth
        return tuple(None if pixels is None else _like(parameters[0], pixels) for pixels in outputs)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, *adjoints: torch.Tensor | None) -> tuple[torch.Tensor | None, ...]:
        image, alpha, depth = (
            None if adjoint is None else adjoint.detach().cpu().numpy() for adjoint in adjoints
        )
        gradients = ctx.view.backward(adj_image=image, adj_alpha=alpha, adj_depth=depth)
        pose = None
        if ctx.pose is not None and ctx.needs_input_grad[1]:
            pose = pose_gradient(camera_gradient(ctx.gaussians, gradients, ctx.camera), ctx.pose)
        found = pose, *(getattr(gradients, name) for name in FIELDS)
        pairs = zip(ctx.inputs, found, strict=True)
        return None, *(None if value is None else _like(tensor, value) for tensor, value in pairs)


def _like(tensor: torch.Tensor, values: np.ndarray) -> torch.Tensor:
    """Return values as a tensor of the same number type on the same device."""
    return torch.as_tensor(values).to(device=tensor.device, dtype=tensor.dtype)
