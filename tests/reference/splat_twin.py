"""Float64 twin of the splat engine, from the formulas of 3D Gaussian splatting, one splat at a time.

Rendering is not differentiable where a splat enters or leaves a pixel (the alpha cut), where alpha is
capped, where a pixel stops, and where a clamp switches. `render_twin` returns every such decision; passing
them back freezes them, and with them frozen the image is a smooth function whose central differences are
the gradient that the kernels compute.
"""

from dataclasses import dataclass, fields, replace

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Camera, pixel_centers
from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.geometry.sh import sh_basis
from digs_warp.splat.camera_motion import STILL, RowMotion
from digs_warp.splat.config import (
    JACOBIAN_MARGIN,
    MAX_ALPHA,
    MIN_ALPHA,
    MIN_TRANSMITTANCE,
    RasterOptions,
)

FEATURES = 4  # red, green, blue, depth


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

    def splat(self, i: int) -> "Parameters":
        return Parameters(*(getattr(self, f.name)[i] for f in fields(self)))


@dataclass
class Decisions:
    """Everything that switches for one splat; frozen for central differences."""

    tangent_clamped: np.ndarray  # (x, y)
    color_clamped: np.ndarray  # (r, g, b)
    compensation_clamped: bool | np.ndarray
    row_clamped: bool | np.ndarray  # the center lies above or below the image ...
    row_edge: float | np.ndarray  # ... -1/2 or 1/2
    drawn: np.ndarray  # pixels it contributes to
    capped: np.ndarray  # pixels where alpha is MAX_ALPHA


@dataclass
class Layer:
    """One splat on the image: alpha per pixel before cap and cut, features, and its decisions."""

    raw: np.ndarray  # (..., height, width)
    features: np.ndarray  # (..., FEATURES)
    decisions: Decisions

    def alpha(self) -> np.ndarray:
        d = self.decisions
        return np.where(d.drawn, np.where(d.capped, MAX_ALPHA, self.raw), 0.0)

    def over(self, behind: np.ndarray, through: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Features and transmittance of this layer before others."""
        alpha = self.alpha()
        sums = alpha[..., None] * self.features[..., None, None, :]
        return sums + (1 - alpha)[..., None] * behind, (1 - alpha) * through


@dataclass
class TwinImage:
    image: np.ndarray  # (height, width, 3)
    transmittance: np.ndarray  # (height, width)
    depth: np.ndarray  # (height, width) expected, 0 where nothing is drawn
    median_depth: np.ndarray  # (height, width) 0 where the transmittance stays above 1/2
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

    def loss_per_pixel(
        self, sums: np.ndarray, transmittance: np.ndarray, background: np.ndarray
    ) -> np.ndarray:
        """Of composited features, shape (..., FEATURES)."""
        image = sums[..., :3] + transmittance[..., None] * background
        depth = _expected(sums[..., 3], transmittance)
        loss = (self.image * image).sum(axis=-1) + self.transmittance * transmittance
        return loss + self.depth * depth


@dataclass
class TwinGradients:
    """dL/dparameter, and what density control sums."""

    parameters: Parameters
    centers: np.ndarray  # (n, 2) dL/d(u, v)


def _expected(weighted: np.ndarray, transmittance: np.ndarray) -> np.ndarray:
    drawn = 1 - transmittance
    return np.divide(weighted, drawn, out=np.zeros_like(weighted), where=drawn > 0)


@dataclass
class TwinView:
    k: np.ndarray  # (4,) fx, fy, cx, cy
    world_from_cam: np.ndarray  # (4, 4)
    width: int
    height: int
    rows: RowMotion = STILL

    @staticmethod
    def of(camera: Camera, rows: RowMotion = STILL) -> "TwinView":
        i = camera.intrinsics
        k = np.array([i.fx, i.fy, i.cx, i.cy])
        return TwinView(k, camera.world_from_cam, i.width, i.height, rows)

    def at(self, moment: np.ndarray) -> np.ndarray:
        """The poses that rows are read from at these moments, shape (..., 4, 4)."""
        x, y, z = self.rows.turn
        half = 0.5 * moment[..., None, None] * np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        motion = np.zeros((*moment.shape, 4, 4))
        # Cayley's rotation, whose angle is 2 atan(|turn| / 2).
        motion[..., :3, :3] = (np.eye(3) + half) @ np.linalg.inv(np.eye(3) - half)
        motion[..., :3, 3] = moment[..., None] * self.rows.shift
        motion[..., 3, 3] = 1
        return self.world_from_cam @ motion


def _seen_from(world_from_cam: np.ndarray, points: np.ndarray) -> np.ndarray:
    rotation_cw = np.swapaxes(world_from_cam[..., :3, :3], -1, -2)
    return np.einsum("...ij,...j->...i", rotation_cw, points - world_from_cam[..., :3, 3])


def layer_of(
    p: Parameters,
    view: TwinView,
    options: RasterOptions,
    frozen: Decisions | None = None,
    shift: np.ndarray | None = None,
) -> Layer:
    """One splat on the image; without ``frozen`` nothing is drawn or capped yet.

    Parameters may have leading axes: that many variants of the splat. ``shift``, (..., 2), moves
    it [px].
    """
    fx, fy, cx, cy = np.moveaxis(view.k, -1, 0)
    _, y, z = np.moveaxis(_seen_from(view.world_from_cam, p.means), -1, 0)
    moment = (fy * y / z + cy) / view.height - 0.5
    off = np.abs(moment) >= 0.5 if frozen is None else frozen.row_clamped
    edge = np.copysign(0.5, moment) if frozen is None else frozen.row_edge
    row_pose = view.at(np.where(off, edge, moment))
    rotation_cw = np.swapaxes(row_pose[..., :3, :3], -1, -2)
    camera_center = view.world_from_cam[..., :3, 3]
    point = _seen_from(row_pose, p.means)
    x, y, z = np.moveaxis(point, -1, 0)
    half = JACOBIAN_MARGIN * 0.5
    low = np.stack([-(cx + half * view.width) / fx, -(cy + half * view.height) / fy], axis=-1)
    high = np.stack(
        [(view.width - cx + half * view.width) / fx, (view.height - cy + half * view.height) / fy],
        axis=-1,
    )
    tangents = np.stack([x / z, y / z], axis=-1)
    clamped = (tangents < low) | (tangents > high) if frozen is None else frozen.tangent_clamped
    limits = np.where(tangents > 0.5 * (low + high), high, low)
    tx, ty = np.moveaxis(np.where(clamped, limits, tangents), -1, 0)
    rotation = matrix_from_quat_xyzw(p.quats)
    axes = rotation_cw @ rotation
    scales = np.exp(p.log_scales)
    m0 = (fx / z)[..., None] * (axes[..., 0, :] - tx[..., None] * axes[..., 2, :]) * scales
    m1 = (fy / z)[..., None] * (axes[..., 1, :] - ty[..., None] * axes[..., 2, :]) * scales
    a = (m0 * m0).sum(axis=-1) + options.dilation
    b = (m0 * m1).sum(axis=-1)
    c = (m1 * m1).sum(axis=-1) + options.dilation
    determinant = a * c - b * b

    opacity = 1 / (1 + np.exp(-p.opacity_logits))
    compensation_clamped = False
    if options.antialias:
        factor = np.linalg.norm(np.cross(m0, m1), axis=-1) / np.sqrt(determinant)
        compensation_clamped = factor < 0.005 if frozen is None else frozen.compensation_clamped
        opacity = opacity * np.where(compensation_clamped, 0.005, factor)

    center = np.stack([fx * x / z + cx, fy * y / z + cy], axis=-1)
    if shift is not None:
        center = center + shift
    offset = pixel_centers(view.width, view.height) - center[..., None, None, :]
    du, dv = offset[..., 0], offset[..., 1]

    def spread(value: np.ndarray) -> np.ndarray:
        return value[..., None, None]

    q = (spread(c) * du * du - 2 * spread(b) * du * dv + spread(a) * dv * dv) / spread(determinant)
    raw = spread(opacity) * np.exp(-0.5 * q)

    direction = p.means - camera_center
    direction = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    basis = sh_basis(direction, round(p.sh.shape[-2] ** 0.5) - 1)
    rgb = 0.5 + np.einsum("...k,...kc->...c", basis, p.sh)
    dark = rgb <= 0 if frozen is None else frozen.color_clamped

    if frozen is None:
        nothing = np.zeros(raw.shape, dtype=bool)
        clamps = (clamped, dark, compensation_clamped, off, edge)
        frozen = Decisions(*clamps, nothing, nothing)
    parts = np.broadcast_arrays(
        *np.moveaxis(np.where(dark, 0.0, rgb), -1, 0),
        z,
    )
    return Layer(raw, np.stack(parts, axis=-1), frozen)


def render_twin(
    p: Parameters,
    camera: Camera,
    near: float,
    background: np.ndarray,
    options: RasterOptions = RasterOptions(),  # noqa: B008 (frozen)
    rows: RowMotion = STILL,
) -> TwinImage:
    """Composite all splats; ``background`` is a color, (3,), or an image, (height, width, 3)."""
    k = camera.intrinsics
    shape = (k.height, k.width)
    view = TwinView.of(camera, rows)
    every = [layer_of(p.splat(i), view, options) for i in range(len(p.means))]
    depths = np.array([layer.features[3] for layer in every])
    opacities = 1 / (1 + np.exp(-p.opacity_logits))
    visible = [i for i in range(len(depths)) if depths[i] > near and opacities[i] > MIN_ALPHA]
    order = sorted(visible, key=lambda i: (np.float32(depths[i]), i))
    layers: dict[int, Layer] = {}
    sums = np.zeros((*shape, FEATURES))
    transmittance = np.ones(shape)
    median = np.zeros(shape)
    alive = np.ones(shape, dtype=bool)
    ambiguous = np.zeros(shape, dtype=bool)
    for i in order:
        layer = every[i]
        raw = layer.raw
        capped = raw > MAX_ALPHA
        alpha = np.where(capped, MAX_ALPHA, raw)
        inside = alive & (alpha >= MIN_ALPHA)
        stops = inside & (transmittance * (1 - alpha) < MIN_TRANSMITTANCE)
        near_cut = np.abs(alpha / MIN_ALPHA - 1) < 1e-4
        near_cap = np.abs(raw / MAX_ALPHA - 1) < 1e-4
        after = transmittance * (1 - alpha)
        near_stop = np.abs(after / MIN_TRANSMITTANCE - 1) < 1e-3
        ambiguous |= alive & (near_cut | near_cap | (inside & near_stop))
        alive &= ~stops
        layer.decisions.drawn = inside & ~stops
        layer.decisions.capped = capped
        layers[i] = layer
        alpha = layer.alpha()
        after = transmittance * (1 - alpha)
        median = np.where((transmittance > 0.5) & (after <= 0.5), layer.features[3], median)
        ambiguous |= layer.decisions.drawn & (np.abs(after - 0.5) < 1e-5)
        sums += (transmittance * alpha)[..., None] * layer.features
        transmittance = after
    image = sums[..., :3] + transmittance[..., None] * background
    depth = _expected(sums[..., 3], transmittance)
    return TwinImage(image, transmittance, depth, median, order, layers, ambiguous)


def twin_gradients(
    p: Parameters,
    camera: Camera,
    twin: TwinImage,
    background: np.ndarray,
    adjoints: Adjoints,
    options: RasterOptions = RasterOptions(),  # noqa: B008 (frozen)
    rows: RowMotion = STILL,
) -> TwinGradients:
    """Central differences of the loss with the decisions of ``twin`` frozen.

    A parameter moves one splat only: the others are composited once before and once behind it.
    """
    gradients = Parameters(*(np.zeros_like(getattr(p, f.name)) for f in fields(Parameters)))
    centers = np.zeros((len(p.means), 2))
    view, shape = TwinView.of(camera, rows), twin.transmittance.shape
    behind = {len(twin.order): (np.zeros((*shape, FEATURES)), np.ones(shape))}
    for position in range(len(twin.order) - 1, -1, -1):
        layer = twin.layers[twin.order[position]]
        behind[position] = layer.over(*behind[position + 1])

    sums, through = np.zeros((*shape, FEATURES)), np.ones(shape)
    for position, i in enumerate(twin.order):

        def loss(layer: Layer, position=position, sums=sums, through=through) -> np.ndarray:
            """Per pixel, of variants of this splat before the rest."""
            features, left = layer.over(*behind[position + 1])
            features = sums + through[..., None] * features
            return adjoints.loss_per_pixel(features, through * left, background)

        splat, frozen = p.splat(i), twin.layers[i].decisions
        for f in fields(Parameters):
            value = getattr(splat, f.name)
            size = 1e-7 if f.name == "means" else 1e-6 * np.maximum(1.0, np.abs(value))
            size = np.broadcast_to(size, value.shape).reshape(-1)
            steps = _steps(size).reshape(-1, *value.shape)
            variants = replace(splat, **{f.name: value + steps})
            losses = loss(layer_of(variants, view, options, frozen)).sum(axis=(-1, -2))
            getattr(gradients, f.name)[i] = _slopes(losses, size).reshape(value.shape)
        size = np.full(2, 1e-5)
        slopes = _slopes(loss(layer_of(splat, view, options, frozen, _steps(size))), size)
        centers[i] = slopes.sum(axis=(-1, -2))
        alpha = twin.layers[i].alpha()
        sums = sums + (through * alpha)[..., None] * twin.layers[i].features
        through = through * (1 - alpha)
    return TwinGradients(gradients, centers)


def _steps(size: np.ndarray) -> np.ndarray:
    """Steps up and then down along every axis, shape (2 k, k)."""
    return np.concatenate([np.diag(size), -np.diag(size)])


def _slopes(values: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Central differences of values at `_steps`."""
    up, down = np.split(values, 2)
    return (up - down) / (2 * size.reshape(-1, *(1,) * (up.ndim - 1)))
