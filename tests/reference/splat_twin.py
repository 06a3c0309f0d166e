"""Float64 twin of the splat engine, from the formulas of 3D Gaussian splatting, one splat at a time.

Rendering is not differentiable where a splat enters or leaves a pixel (the alpha cut), where alpha is
capped, where a pixel stops, and where a clamp switches. `render_twin` returns every such decision; passing
them back freezes them, and with them frozen the image is a smooth function whose central differences are
the gradient that the kernels compute.
"""

from dataclasses import dataclass, fields, replace

import numpy as np

from digs_warp.camera import Camera, pixel_centers
from digs_warp.gaussians import Gaussians
from digs_warp.geometry import matrix_from_quat_xyzw, transform_points
from digs_warp.sh import sh_basis

MIN_ALPHA = 1 / 255
MAX_ALPHA = 0.99
STOP = 1e-4
DILATION = 0.3
MARGIN = 0.3


@dataclass
class Parameters:
    means: np.ndarray
    log_scales: np.ndarray
    quats: np.ndarray
    opacity_logits: np.ndarray
    sh: np.ndarray

    @staticmethod
    def of(gaussians: Gaussians) -> "Parameters":
        return Parameters(
            *(getattr(gaussians, f.name).astype(np.float64) for f in fields(Parameters))
        )


@dataclass
class Decisions:
    """Everything that switches; frozen for central differences."""

    order: list[int]  # visible splats, front to back
    tangent_clamped: dict[int, np.ndarray]  # splat -> (x, y)
    color_clamped: dict[int, np.ndarray]  # splat -> (r, g, b)
    drawn: dict[int, np.ndarray]  # splat -> pixels it contributes to
    capped: dict[int, np.ndarray]  # splat -> pixels where alpha is MAX_ALPHA


@dataclass
class TwinImage:
    image: np.ndarray  # (height, width, 3)
    transmittance: np.ndarray  # (height, width)
    decisions: Decisions
    # Pixels where a decision is so close that float32 may take it the other way.
    ambiguous: np.ndarray


def project_splat(
    p: Parameters, i: int, camera: Camera, frozen: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (centre px, dilated covariance, which tangents are clamped) of splat i."""
    k = camera.intrinsics
    x, y, z = transform_points(camera.cam_from_world, p.means[i])
    limits_x = (
        -k.cx / k.fx - MARGIN * 0.5 * k.width / k.fx,
        (k.width - k.cx) / k.fx + MARGIN * 0.5 * k.width / k.fx,
    )
    limits_y = (
        -k.cy / k.fy - MARGIN * 0.5 * k.height / k.fy,
        (k.height - k.cy) / k.fy + MARGIN * 0.5 * k.height / k.fy,
    )
    tangents = np.array([x / z, y / z])
    limited = np.array([np.clip(x / z, *limits_x), np.clip(y / z, *limits_y)])
    clamped = limited != tangents if frozen is None else frozen
    tx, ty = np.where(clamped, limited, tangents)
    jacobian = np.array([[k.fx / z, 0, -k.fx * tx / z], [0, k.fy / z, -k.fy * ty / z]])
    rotation = matrix_from_quat_xyzw(p.quats[i])
    half = rotation @ np.diag(np.exp(p.log_scales[i]))
    world_to_px = jacobian @ camera.cam_from_world[:3, :3]
    covariance = world_to_px @ half @ half.T @ world_to_px.T + DILATION * np.eye(2)
    return np.array([k.fx * x / z + k.cx, k.fy * y / z + k.cy]), covariance, clamped


def render_twin(
    p: Parameters,
    camera: Camera,
    near: float,
    background: np.ndarray,
    frozen: Decisions | None = None,
) -> TwinImage:
    k = camera.intrinsics
    px = pixel_centers(k.width, k.height)
    degree = round(p.sh.shape[1] ** 0.5) - 1
    depths = transform_points(camera.cam_from_world, p.means)[:, 2]
    opacities = 1 / (1 + np.exp(-p.opacity_logits))
    if frozen is None:
        visible = [i for i in range(len(depths)) if depths[i] > near and opacities[i] > MIN_ALPHA]
        order = sorted(visible, key=lambda i: (np.float32(depths[i]), i))
    else:
        order = frozen.order
    made = Decisions(order, {}, {}, {}, {})
    color = np.zeros((k.height, k.width, 3))
    transmittance = np.ones((k.height, k.width))
    alive = np.ones((k.height, k.width), dtype=bool)
    ambiguous = np.zeros((k.height, k.width), dtype=bool)
    for i in order:
        center, covariance, clamped = project_splat(
            p, i, camera, frozen.tangent_clamped[i] if frozen else None
        )
        offset = px - center
        q = np.einsum("hwi,ij,hwj->hw", offset, np.linalg.inv(covariance), offset)
        raw = opacities[i] * np.exp(-0.5 * q)
        direction = p.means[i] - camera.center_world
        basis = sh_basis(direction / np.linalg.norm(direction), degree)
        rgb = 0.5 + basis @ p.sh[i]
        if frozen is None:
            capped = raw > MAX_ALPHA
            alpha = np.where(capped, MAX_ALPHA, raw)
            inside = alive & (alpha >= MIN_ALPHA)
            stops = inside & (transmittance * (1 - alpha) < STOP)
            near_cut = np.abs(alpha / MIN_ALPHA - 1) < 1e-4
            near_cap = np.abs(raw / MAX_ALPHA - 1) < 1e-4
            near_stop = np.abs(transmittance * (1 - alpha) / STOP - 1) < 1e-3
            ambiguous |= alive & (near_cut | near_cap | (inside & near_stop))
            alive &= ~stops
            drawn = inside & ~stops
            dark = rgb <= 0
        else:
            capped, drawn, dark = frozen.capped[i], frozen.drawn[i], frozen.color_clamped[i]
        made.tangent_clamped[i], made.color_clamped[i] = clamped, dark
        made.drawn[i], made.capped[i] = drawn, capped
        alpha = np.where(drawn, np.where(capped, MAX_ALPHA, raw), 0.0)
        color += (transmittance * alpha)[..., None] * np.where(dark, 0.0, rgb)
        transmittance = transmittance * (1 - alpha)
    image = color + transmittance[..., None] * background
    return TwinImage(image, transmittance, made, ambiguous)


def twin_gradients(
    p: Parameters,
    camera: Camera,
    near: float,
    background: np.ndarray,
    adj_image: np.ndarray,
    adj_transmittance: np.ndarray,
) -> Parameters:
    """Central differences of sum(adj_image * image) + sum(adj_transmittance * T), decisions frozen."""
    frozen = render_twin(p, camera, near, background).decisions

    def objective(q: Parameters) -> float:
        out = render_twin(q, camera, near, background, frozen)
        return float((adj_image * out.image).sum() + (adj_transmittance * out.transmittance).sum())

    gradients = {}
    for f in fields(Parameters):
        value = getattr(p, f.name)
        gradient = np.zeros_like(value)
        for index in np.ndindex(*value.shape):
            step = 1e-6 * max(1.0, abs(value[index])) if f.name != "means" else 1e-7
            up, down = value.copy(), value.copy()
            up[index] += step
            down[index] -= step
            high = objective(replace(p, **{f.name: up}))
            low = objective(replace(p, **{f.name: down}))
            gradient[index] = (high - low) / (2 * step)
        gradients[f.name] = gradient
    return Parameters(**gradients)
