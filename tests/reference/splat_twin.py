"""Float64 twin of the splat engine, from the formulas of 3D Gaussian splatting, one splat at a time.

Rendering is not differentiable where a splat enters or leaves a pixel (the alpha cut), where alpha is
capped, where a pixel stops, and where a clamp switches. All of these look at real parts alone, so that a
tiny imaginary step in a parameter leaves them as they are: the imaginary part of a smooth function, divided
by the step, is its derivative, which is the gradient that the kernels compute.
"""

from dataclasses import dataclass

import numpy as np

from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.geometry.camera import Camera, pixel_centers
from digs_warp.geometry.sh import sh_basis
from digs_warp.splat.camera_motion import RowMotion
from digs_warp.splat.config import (
    JACOBIAN_MARGIN,
    MAX_ALPHA,
    MIN_ALPHA,
    MIN_TRANSMITTANCE,
    RasterOptions,
)
from reference.splat_scenes import BACKGROUND, SplatScene

FEATURES = 4  # red, green, blue, depth
STEP = 1e-30

# One splat by `FIELDS`; with a leading axis, that many variants of it.
Splat = dict[str, np.ndarray]


@dataclass
class Layer:
    """One splat on the image."""

    raw: np.ndarray  # (..., height, width) alpha before cap and cut
    features: np.ndarray  # (..., FEATURES)
    drawn: np.ndarray  # (height, width), bool

    @property
    def alpha(self) -> np.ndarray:
        return np.where(
            self.drawn, np.where(np.real(self.raw) > MAX_ALPHA, MAX_ALPHA, self.raw), 0.0
        )

    def over(self, behind: np.ndarray, through: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Features and transmittance of this layer before others."""
        alpha = self.alpha
        sums = alpha[..., None] * self.features[..., None, None, :]
        return sums + (1 - alpha)[..., None] * behind, (1 - alpha) * through


@dataclass
class TwinImage:
    image: np.ndarray  # (height, width, 3)
    transmittance: np.ndarray  # (height, width)
    depth: np.ndarray  # (height, width) expected, 0 where nothing is drawn
    median_depth: np.ndarray  # (height, width) 0 where the transmittance stays above 1/2
    layers: dict[int, Layer]  # of the visible splats, front to back
    # Pixels where a decision is so close that float32 may take it the other way.
    ambiguous: np.ndarray


@dataclass
class Adjoints:
    """Gradients of a loss in the outputs; the loss is their product with the outputs."""

    image: np.ndarray
    transmittance: np.ndarray
    depth: np.ndarray

    def loss_per_pixel(self, sums: np.ndarray, transmittance: np.ndarray) -> np.ndarray:
        """Of composited features, shape (..., FEATURES)."""
        image, depth = _outputs(sums, transmittance)
        loss = (self.image * image).sum(axis=-1) + self.transmittance * transmittance
        return loss + self.depth * depth


def _outputs(sums: np.ndarray, transmittance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Image and expected depth."""
    drawn = 1 - transmittance
    depth = np.divide(
        sums[..., 3], drawn, out=np.zeros_like(sums[..., 3]), where=np.real(drawn) > 0
    )
    return sums[..., :3] + transmittance[..., None] * BACKGROUND, depth


def splats_of(gaussians: Gaussians) -> list[Splat]:
    arrays = {name: getattr(gaussians, name).astype(np.float64) for name in FIELDS}
    return [{name: a[i] for name, a in arrays.items()} for i in range(len(gaussians))]


def pose_at(camera: Camera, rows: RowMotion, moment: np.ndarray) -> np.ndarray:
    """The poses that rows are read from at these moments, shape (..., 4, 4)."""
    half = 0.5 * moment[..., None, None] * _crossing(rows.turn)
    motion = np.zeros((*moment.shape, 4, 4), moment.dtype)
    # Cayley's rotation, whose angle is 2 atan(|turn| / 2).
    motion[..., :3, :3] = (np.eye(3) + half) @ np.linalg.inv(np.eye(3) - half)
    motion[..., :3, 3] = moment[..., None] * rows.shift
    motion[..., 3, 3] = 1
    return camera.world_from_cam @ motion


def _crossing(vectors: np.ndarray) -> np.ndarray:
    """The matrices of cross products, (..., 3, 3)."""
    return np.cross(vectors[..., None, :], -np.eye(3))


def _rotation(quats: np.ndarray) -> np.ndarray:
    length = _length(quats)
    unit = quats / np.where(length == 0, 1, length)
    crossing = _crossing(unit[..., :3])
    return np.eye(3) + 2 * unit[..., 3, None, None] * crossing + 2 * crossing @ crossing


def _length(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt((vectors * vectors).sum(axis=-1, keepdims=True))


def _seen_from(world_from_cam: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Coordinates of a point in the camera, each (...)."""
    rotation_cw = np.swapaxes(world_from_cam[..., :3, :3], -1, -2)
    away = points - world_from_cam[..., :3, 3]
    return np.moveaxis(np.einsum("...ij,...j->...i", rotation_cw, away), -1, 0)


def layer_of(
    p: Splat,
    scene: SplatScene,
    options: RasterOptions,
    drawn: np.ndarray,
    shift: np.ndarray | float = 0.0,
) -> Layer:
    """One splat, moved on the image by ``shift``, (..., 2) [px]."""
    camera, k, means = scene.camera, scene.camera.intrinsics, p["means"]
    _, y, z = _seen_from(camera.world_from_cam, means)
    moment = (k.fy * y / z + k.cy) / k.height - 0.5
    off = np.abs(moment.real) >= 0.5  # the center lies above or below the image
    row_pose = pose_at(camera, scene.rows, np.where(off, np.copysign(0.5, moment.real), moment))
    x, y, z = _seen_from(row_pose, means)
    size, focal, center = (
        np.array(pair) for pair in ((k.width, k.height), (k.fx, k.fy), (k.cx, k.cy))
    )
    half = JACOBIAN_MARGIN * 0.5 * size
    tangents = np.stack([x / z, y / z], axis=-1)
    low, high = -(center + half) / focal, (size - center + half) / focal
    clamped = np.where(
        np.real(tangents) < low, low, np.where(np.real(tangents) > high, high, tangents)
    )
    axes = np.swapaxes(row_pose[..., :3, :3], -1, -2) @ _rotation(p["quats"])
    m0, m1 = (
        (focal[i] / z)[..., None]
        * (axes[..., i, :] - clamped[..., i, None] * axes[..., 2, :])
        * np.exp(p["log_scales"])
        for i in range(2)
    )
    a = (m0 * m0).sum(axis=-1) + options.dilation
    b = (m0 * m1).sum(axis=-1)
    c = (m1 * m1).sum(axis=-1) + options.dilation
    determinant = a * c - b * b
    opacity = 1 / (1 + np.exp(-p["opacity_logits"]))
    if options.antialias:
        factor = _length(np.cross(m0, m1))[..., 0] / np.sqrt(determinant)
        opacity = opacity * np.where(factor.real < 0.005, 0.005, factor)
    places = focal * tangents + center + shift
    offset = pixel_centers(k.width, k.height) - places[..., None, None, :]
    du, dv = offset[..., 0], offset[..., 1]
    a, b, c, determinant, opacity = (v[..., None, None] for v in (a, b, c, determinant, opacity))
    raw = opacity * np.exp(-0.5 * (c * du * du - 2 * b * du * dv + a * dv * dv) / determinant)

    direction = means - camera.center_world
    basis = sh_basis(direction / _length(direction), round(p["sh"].shape[-2] ** 0.5) - 1)
    rgb = 0.5 + np.einsum("...k,...kc->...c", basis, p["sh"])
    rgb = np.where(rgb.real <= 0, 0.0, rgb)
    parts = np.broadcast_arrays(*np.moveaxis(rgb, -1, 0), z)
    return Layer(raw, np.stack(parts, axis=-1), drawn)


def render_twin(scene: SplatScene, options: RasterOptions) -> TwinImage:
    """Composite all splats."""
    k = scene.camera.intrinsics
    shape = (k.height, k.width)
    every = [layer_of(p, scene, options, np.zeros(shape, bool)) for p in splats_of(scene.gaussians)]
    depths = np.array([layer.features[3] for layer in every])
    opacities = 1 / (1 + np.exp(-scene.gaussians.opacity_logits.astype(np.float64)))
    visible = [i for i in range(len(every)) if depths[i] > scene.near and opacities[i] > MIN_ALPHA]
    layers = {i: every[i] for i in sorted(visible, key=lambda i: (np.float32(depths[i]), i))}
    sums, transmittance, median = np.zeros((*shape, FEATURES)), np.ones(shape), np.zeros(shape)
    alive, ambiguous = np.ones(shape, dtype=bool), np.zeros(shape, dtype=bool)
    for layer in layers.values():
        alpha = np.minimum(layer.raw, MAX_ALPHA)
        inside = alive & (alpha >= MIN_ALPHA)
        after = transmittance * (1 - alpha)
        near_cut = np.abs(alpha / MIN_ALPHA - 1) < 1e-4
        near_cap = np.abs(layer.raw / MAX_ALPHA - 1) < 1e-4
        near_stop = np.abs(after / MIN_TRANSMITTANCE - 1) < 1e-3
        ambiguous |= alive & (near_cut | near_cap | (inside & near_stop))
        alive &= ~(inside & (after < MIN_TRANSMITTANCE))
        layer.drawn = inside & alive
        alpha = layer.alpha
        after = transmittance * (1 - alpha)
        median = np.where((transmittance > 0.5) & (after <= 0.5), layer.features[3], median)
        ambiguous |= layer.drawn & (np.abs(after - 0.5) < 1e-5)
        sums += (transmittance * alpha)[..., None] * layer.features
        transmittance = after
    image, depth = _outputs(sums, transmittance)
    return TwinImage(image, transmittance, depth, median, layers, ambiguous)


def twin_gradients(
    scene: SplatScene, twin: TwinImage, adjoints: Adjoints, options: RasterOptions
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return dL/dparameter by `FIELDS`, and dL/d(u, v) of the centers, (n, 2), which density control sums.

    A parameter moves one splat only: the others are composited once before and once behind it.
    """
    splats, shape = splats_of(scene.gaussians), twin.transmittance.shape
    gradients = {name: np.zeros(getattr(scene.gaussians, name).shape) for name in FIELDS}
    centers = np.zeros((len(splats), 2))
    behind = [(np.zeros((*shape, FEATURES)), np.ones(shape))]
    for layer in reversed(twin.layers.values()):
        behind.append(layer.over(*behind[-1]))
    sums, through = np.zeros((*shape, FEATURES)), np.ones(shape)
    for i, own in twin.layers.items():
        behind.pop()

        def slopes(
            splat: Splat, shift: np.ndarray | float, own=own, sums=sums, through=through
        ) -> np.ndarray:
            """Of the loss along the imaginary steps in variants of this splat before the rest."""
            features, left = layer_of(splat, scene, options, own.drawn, shift).over(*behind[-1])
            features = sums + through[..., None] * features
            loss = adjoints.loss_per_pixel(features, through * left)
            return np.imag(loss).sum(axis=(-1, -2)) / STEP

        for name, value in splats[i].items():
            steps = 1j * STEP * np.eye(value.size).reshape(-1, *value.shape)
            found = slopes(splats[i] | {name: value + steps}, 0.0)
            gradients[name][i] = found.reshape(value.shape)
        centers[i] = slopes(splats[i], 1j * STEP * np.eye(2))
        sums = sums + (through * own.alpha)[..., None] * own.features
        through = through * (1 - own.alpha)
    return gradients, centers
