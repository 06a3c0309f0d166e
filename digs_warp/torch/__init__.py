# torch is an extra that type checking need not have:
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false
"""`digs_warp.render` for PyTorch: tensors in, tensors out, differentiated by `torch.autograd`.

    import digs_warp.torch

    view = digs_warp.torch.render(means, log_scales, quats, opacity_logits, sh, camera)
    ((view.image - target) ** 2).mean().backward()

The kernels compute in float32 on the CPU; tensors of other types and devices are converted, and so are
their gradients. Gradients of gradients are not available.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

try:
    import torch
except ModuleNotFoundError as error:
    raise ModuleNotFoundError("digs_warp.torch needs PyTorch: pip install torch") from error

from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.geometry.camera import Camera
from digs_warp.splat.camera_gradient import moved_camera, pose_gradient
from digs_warp.splat.config import DEFAULT_OPTIONS, RasterOptions
from digs_warp.splat.render import render as render_numpy
from digs_warp.splat.renderer import WHITE

__all__ = ["TorchView", "render"]


class TorchView(NamedTuple):
    """A rendered view; see `digs_warp.splat.render.RenderOutput`.

    Attributes:
        image: sRGB, shape (height, width, 3).
        alpha: coverage in 0..1, shape (height, width).
        depth: expected planar depth [m], NaN where nothing is drawn, (height, width); None unless asked for.
        normals: sum of the weighted unit normals, camera axes, (height, width, 3); None unless asked for.
    """

    image: torch.Tensor
    alpha: torch.Tensor
    depth: torch.Tensor | None
    normals: torch.Tensor | None


@dataclass(frozen=True, eq=False)
class _Settings:
    camera: Camera
    near: float | None
    background: Any
    options: RasterOptions


def render(
    means: torch.Tensor,
    log_scales: torch.Tensor,
    quats: torch.Tensor,
    opacity_logits: torch.Tensor,
    sh: torch.Tensor,
    camera: Camera,
    *,
    pose: torch.Tensor | None = None,
    near: float | None = None,
    background: tuple[float, float, float] | np.ndarray = WHITE,
    options: RasterOptions = DEFAULT_OPTIONS,
) -> TorchView:
    """Render one view of Gaussians.

    Args:
        means: centers [m], shape (n, 3); this and the next four as in `digs_warp.data.gaussians.Gaussians`.
        log_scales: shape (n, 3).
        quats: xyzw, shape (n, 4).
        opacity_logits: shape (n,).
        sh: shape (n, K, 3).
        camera: from where.
        pose: a motion of the camera to optimize, shape (6,), see `moved_camera`.
        near: near plane [m]; default: a share of the distance to the middle of the Gaussians.
        background: sRGB color, or image of shape (height, width, 3), behind the Gaussians; a constant.
        options: how splats are drawn, and whether depth and normals are wanted. Tensors do not say what they
            are made for: scenes of 3D Gaussian splatting want a dilation of 0.3.

    Raises:
        DigsError: tensors of other shapes, or values that are not finite.
    """
    settings = _Settings(camera, near, background, options)
    parameters = means, log_scales, quats, opacity_logits, sh
    return TorchView(*_Render.apply(settings, pose, *parameters))


class _Render(torch.autograd.Function):
    """The connection between autograd and the NumPy adjoints of a view."""

    @staticmethod
    def forward(
        ctx: Any, settings: _Settings, pose: torch.Tensor | None, *parameters: torch.Tensor
    ) -> tuple[torch.Tensor | None, ...]:
        ctx.set_materialize_grads(False)
        ctx.pose, camera = None, settings.camera
        if pose is not None:
            ctx.pose = pose.detach().cpu().double().numpy()
            camera = moved_camera(camera, ctx.pose)
        ctx.inputs = pose, *parameters
        ctx.view = view = render_numpy(
            Gaussians(*(tensor.detach().cpu().float().numpy() for tensor in parameters)),
            camera,
            near=settings.near,
            background=settings.background,
            options=settings.options,
            camera_gradient=pose is not None and pose.requires_grad,
        )
        outputs = view.image, view.alpha, view.depth, view.normals
        return tuple(None if pixels is None else _like(parameters[0], pixels) for pixels in outputs)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, *adjoints: torch.Tensor | None) -> tuple[torch.Tensor | None, ...]:
        image, alpha, depth, normals = (
            None if adjoint is None else adjoint.detach().cpu().numpy() for adjoint in adjoints
        )
        gradients = ctx.view.backward(
            adj_image=image, adj_alpha=alpha, adj_depth=depth, adj_normals=normals
        )
        pose = None
        if gradients.camera is not None:
            pose = pose_gradient(gradients.camera, ctx.pose)
        found = pose, *(getattr(gradients, name) for name in FIELDS)
        pairs = zip(ctx.inputs, found, strict=True)
        return None, *(None if value is None else _like(tensor, value) for tensor, value in pairs)


def _like(tensor: torch.Tensor, values: np.ndarray) -> torch.Tensor:
    """Return values as a tensor of the same number type on the same device."""
    return torch.as_tensor(values).to(device=tensor.device, dtype=tensor.dtype)
