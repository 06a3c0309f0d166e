"""Float64 twin of the splat engine, from the formulas of 3D Gaussian splatting, one splat at a time.

Rendering is not differentiable where a splat enters or leaves a pixel (the alpha cut), where alpha is
capped, where a pixel stops, and where a clamp switches. `render_twin` returns every such decision; passing
them back freezes them, and with them frozen the image is a smooth function whose central differences are
the gradient that the kernels compute.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.spatial.transform import Rotation

from digs_warp.camera import Camera, pixel_centers
from digs_warp.gaussians import Gaussians
from digs_warp.geometry import matrix_from_quat_xyzw, transform_points
from digs_warp.sh import sh_basis
from digs_warp.splat.config import RasterOptions

FEATURES = 7  # red, green, blue, depth, normal


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
    """Everything that switches for one splat; frozen for central differences."""

    tangent_clamped: np.ndarray  # (x, y)
    color_clamped: np.ndarray  # (r, g, b)
    compensation_clamped: bool
    normal_axis: int
    normal_sign: float
    drawn: np.ndarray  # pixels it contributes to
    capped: np.ndarray  # pixels where alpha is max_alpha


@dataclass
class Layer:
    """One splat on the image: alpha per pixel before cap and cut, features, and its decisions."""

    raw: np.ndarray  # (height, width)
    features: np.ndarray  # (FEATURES,)
    decisions: Decisions
    center: np.ndarray  # (2,) px

    def alpha(self, max_alpha: float) -> np.ndarray:
        d = self.decisions
        return np.where(d.drawn, np.where(d.capped, max_alpha, self.raw), 0.0)


@dataclass
class TwinImage:
    image: np.ndarray  # (height, width, 3)
    transmittance: np.ndarray  # (height, width)
    depth: np.ndarray  # (height, width) expected, 0 where nothing is drawn
    median_depth: np.ndarray  # (height, width) 0 where the transmittance stays above 1/2
    normals: np.ndarray  # (height, width, 3)
    order: list[int]  # visible splats, front to back
    layers: dict[int, Layer]
    # Pixels where a decision is so close that float32 may take it the other way.
    ambiguous: np.ndarray


@dataclass
class Adjoints:
    """Gradients of a loss in the outputs; the loss is their product with the outputs."""

    image: np.ndarray
    transmittance: np.ndarray
    depth: np.ndarray
    normals: np.ndarray

    def loss_per_pixel(
        self, sums: np.ndarray, transmittance: np.ndarray, background: np.ndarray
    ) -> np.ndarray:
        """Of composited features, shape (..., FEATURES)."""
        image = sums[..., :3] + transmittance[..., None] * background
        depth = _expected(sums[..., 3], transmittance)
        loss = (self.image * image).sum(axis=-1) + self.transmittance * transmittance
        return loss + self.depth * depth + (self.normals * sums[..., 4:]).sum(axis=-1)


@dataclass
class TwinGradients:
    """dL/dparameter, dL/d(camera), and what density control sums."""

    parameters: Parameters
    camera: np.ndarray  # (10,) rotation vector, translation, fx, fy, cx, cy
    centers: np.ndarray  # (n, 2) dL/d(u, v)
    absolute_centers: np.ndarray  # (n, 2) sums over pixels of |dL/d(u, v)|


def _expected(weighted: np.ndarray, transmittance: np.ndarray) -> np.ndarray:
    drawn = 1 - transmittance
    return np.divide(weighted, drawn, out=np.zeros_like(weighted), where=drawn > 0)


def moved(camera: Camera, change: np.ndarray) -> Camera:
    """The camera after a motion in its own frame and a change of intrinsics, shape (10,)."""
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(change[:3]).as_matrix()
    motion[:3, 3] = change[3:6]
    k = camera.intrinsics
    fx, fy, cx, cy = np.array([k.fx, k.fy, k.cx, k.cy]) + change[6:]
    return Camera(replace(k, fx=fx, fy=fy, cx=cx, cy=cy), camera.world_from_cam @ motion)


def layer_of(
    p: Parameters,
    i: int,
    camera: Camera,
    options: RasterOptions,
    frozen: Decisions | None = None,
    shift: np.ndarray | None = None,
) -> Layer:
    """Splat i on the image; without ``frozen`` nothing is drawn or capped yet. ``shift`` moves it [px]."""
    k = camera.intrinsics
    x, y, z = transform_points(camera.cam_from_world, p.means[i])
    half = options.jacobian_margin * 0.5
    limits_x = -(k.cx + half * k.width) / k.fx, (k.width - k.cx + half * k.width) / k.fx
    limits_y = -(k.cy + half * k.height) / k.fy, (k.height - k.cy + half * k.height) / k.fy
    tangents = np.array([x / z, y / z])
    limited = np.array([np.clip(x / z, *limits_x), np.clip(y / z, *limits_y)])
    clamped = limited != tangents if frozen is None else frozen.tangent_clamped
    if frozen is not None:
        # The limit that holds, also where the perturbed tangent is back inside.
        middle = 0.5 * np.array([sum(limits_x), sum(limits_y)])
        upper = tangents > middle
        limited = np.where(upper, [limits_x[1], limits_y[1]], [limits_x[0], limits_y[0]])
    tx, ty = np.where(clamped, limited, tangents)
    jacobian = np.array([[k.fx / z, 0, -k.fx * tx / z], [0, k.fy / z, -k.fy * ty / z]])
    rotation = matrix_from_quat_xyzw(p.quats[i])
    root = jacobian @ camera.cam_from_world[:3, :3] @ rotation @ np.diag(np.exp(p.log_scales[i]))
    sharp = root @ root.T
    covariance = sharp + options.dilation * np.eye(2)

    opacity = 1 / (1 + np.exp(-p.opacity_logits[i]))
    compensation_clamped = False
    if options.antialias:
        # Gram determinant: det(root root^T) itself cancels for needles.
        factor = np.linalg.norm(np.cross(root[0], root[1])) / np.sqrt(np.linalg.det(covariance))
        compensation_clamped = factor < 0.005 if frozen is None else frozen.compensation_clamped
        opacity *= 0.005 if compensation_clamped else factor

    center = np.array([k.fx * x / z + k.cx, k.fy * y / z + k.cy])
    offset = pixel_centers(k.width, k.height) - center - (0 if shift is None else shift)
    (a, b), (_, c) = np.linalg.inv(covariance)
    du, dv = offset[..., 0], offset[..., 1]
    raw = opacity * np.exp(-0.5 * (a * du * du + 2 * b * du * dv + c * dv * dv))

    direction = p.means[i] - camera.center_world
    basis = sh_basis(direction / np.linalg.norm(direction), round(p.sh.shape[1] ** 0.5) - 1)
    rgb = 0.5 + basis @ p.sh[i]
    dark = rgb <= 0 if frozen is None else frozen.color_clamped

    axes = camera.cam_from_world[:3, :3] @ rotation
    axis = int(np.argmin(p.log_scales[i])) if frozen is None else frozen.normal_axis
    facing = -1.0 if axes[:, axis] @ (x, y, z) > 0 else 1.0
    sign = facing if frozen is None else frozen.normal_sign

    nothing = np.zeros(raw.shape, dtype=bool)
    decisions = frozen or Decisions(
        clamped, dark, compensation_clamped, axis, sign, nothing, nothing
    )
    return Layer(
        raw, np.array([*np.where(dark, 0.0, rgb), z, *(sign * axes[:, axis])]), decisions, center
    )


def render_twin(
    p: Parameters,
    camera: Camera,
    near: float,
    background: np.ndarray,
    options: RasterOptions = RasterOptions(),  # noqa: B008 (frozen)
) -> TwinImage:
    """Composite all splats; ``background`` is a colour, (3,), or an image, (height, width, 3)."""
    k = camera.intrinsics
    shape = (k.height, k.width)
    depths = transform_points(camera.cam_from_world, p.means)[:, 2]
    opacities = 1 / (1 + np.exp(-p.opacity_logits))
    visible = [
        i for i in range(len(depths)) if depths[i] > near and opacities[i] > options.min_alpha
    ]
    order = sorted(visible, key=lambda i: (np.float32(depths[i]), i))
    layers: dict[int, Layer] = {}
    sums = np.zeros((*shape, FEATURES))
    transmittance = np.ones(shape)
    median = np.zeros(shape)
    alive = np.ones(shape, dtype=bool)
    ambiguous = np.zeros(shape, dtype=bool)
    for i in order:
        layer = layer_of(p, i, camera, options)
        raw = layer.raw
        capped = raw > options.max_alpha
        alpha = np.where(capped, options.max_alpha, raw)
        inside = alive & (alpha >= options.min_alpha)
        stops = inside & (transmittance * (1 - alpha) < options.min_transmittance)
        near_cut = np.abs(alpha / options.min_alpha - 1) < 1e-4
        near_cap = np.abs(raw / options.max_alpha - 1) < 1e-4
        after = transmittance * (1 - alpha)
        near_stop = np.abs(after / options.min_transmittance - 1) < 1e-3
        ambiguous |= alive & (near_cut | near_cap | (inside & near_stop))
        alive &= ~stops
        layer.decisions.drawn = inside & ~stops
        layer.decisions.capped = capped
        layers[i] = layer
        alpha = layer.alpha(options.max_alpha)
        after = transmittance * (1 - alpha)
        median = np.where((transmittance > 0.5) & (after <= 0.5), layer.features[3], median)
        ambiguous |= layer.decisions.drawn & (np.abs(after - 0.5) < 1e-5)
        sums += (transmittance * alpha)[..., None] * layer.features
        transmittance = after
    image = sums[..., :3] + transmittance[..., None] * background
    depth = _expected(sums[..., 3], transmittance)
    return TwinImage(image, transmittance, depth, median, sums[..., 4:], order, layers, ambiguous)


def composite(
    twin: TwinImage, splats: list[int], max_alpha: float
) -> tuple[np.ndarray, np.ndarray]:
    """Features and transmittance of some layers, front to back."""
    sums = np.zeros((*twin.transmittance.shape, FEATURES))
    transmittance = np.ones(twin.transmittance.shape)
    for i in splats:
        alpha = twin.layers[i].alpha(max_alpha)
        sums += (transmittance * alpha)[..., None] * twin.layers[i].features
        transmittance = transmittance * (1 - alpha)
    return sums, transmittance


def twin_gradients(
    p: Parameters,
    camera: Camera,
    twin: TwinImage,
    background: np.ndarray,
    adjoints: Adjoints,
    options: RasterOptions = RasterOptions(),  # noqa: B008 (frozen)
) -> TwinGradients:
    """Central differences of the loss with the decisions of ``twin`` frozen.

    A parameter moves one splat only: the others are composited once before and once behind it.
    """
    gradients = Parameters(*(np.zeros_like(getattr(p, f.name)) for f in fields(Parameters)))
    centers, absolute = np.zeros((len(p.means), 2)), np.zeros((len(p.means), 2))
    for position, i in enumerate(twin.order):
        before, t_before = composite(twin, twin.order[:position], options.max_alpha)
        behind, t_behind = composite(twin, twin.order[position + 1 :], options.max_alpha)

        def loss(
            layer: Layer,
            before: np.ndarray = before,
            t_before: np.ndarray = t_before,
            behind: np.ndarray = behind,
            t_behind: np.ndarray = t_behind,
        ) -> np.ndarray:
            alpha = layer.alpha(options.max_alpha)
            through = t_before * (1 - alpha)
            sums = before + (t_before * alpha)[..., None] * layer.features
            sums += through[..., None] * behind
            return adjoints.loss_per_pixel(sums, through * t_behind, background)

        frozen = twin.layers[i].decisions
        for f in fields(Parameters):
            value = getattr(p, f.name)
            for index in np.ndindex(*value.shape[1:]):
                at = (i, *index)

                def changed(step: float, f=f, at=at, value=value, i=i, frozen=frozen, loss=loss):
                    other = value.copy()
                    other[at] += step
                    q = replace(p, **{f.name: other})
                    return loss(layer_of(q, i, camera, options, frozen)).sum()

                size = 1e-7 if f.name == "means" else 1e-6 * max(1.0, abs(value[at]))
                getattr(gradients, f.name)[at] = _slope(changed, size)
        for axis in range(2):

            def shifted(step: float, axis=axis, i=i, frozen=frozen, loss=loss) -> np.ndarray:
                return loss(layer_of(p, i, camera, options, frozen, step * np.eye(2)[axis]))

            slopes = _slope(shifted, 1e-5)
            centers[i, axis], absolute[i, axis] = slopes.sum(), np.abs(slopes).sum()

    def seen(change: np.ndarray) -> float:
        view = moved(camera, change)
        layers = {
            i: layer_of(p, i, view, options, layer.decisions) for i, layer in twin.layers.items()
        }
        sums, transmittance = composite(replace(twin, layers=layers), twin.order, options.max_alpha)
        return adjoints.loss_per_pixel(sums, transmittance, background).sum()

    sizes = np.array([1e-6] * 6 + [1e-5] * 4)
    motion = np.array(
        [
            _slope(lambda step, axis=axis: seen(step * np.eye(10)[axis]), sizes[axis])
            for axis in range(10)
        ]
    )
    return TwinGradients(gradients, motion, centers, absolute)


def _slope(function: Callable, size: float):
    return (function(size) - function(-size)) / (2 * size)
