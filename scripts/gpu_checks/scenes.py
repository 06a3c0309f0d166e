"""A synthetic scene that is like a real one: a textured body in a room, both layers of flat splats."""

from dataclasses import replace

import numpy as np
import warp as wp

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at, quat_xyzw_from_matrix
from digs_warp.geometry.sh import coefficient_count, sh_from_rgb
from digs_warp.train.smoothing import VARIANCE, sampling_distances

NEAR = 0.05  # near plane [m]
EXTENT = 2.5  # distance of the cameras from the body [m], the unit of the rate of the centers

ROOM_SHARE = 0.25  # of the splats; most of them are outside of any one view
BODY_RADIUS, ROOM_RADIUS = 1.0, 5.0  # [m]
DEGREE = 3


def body_in_room(count: int, seed: int = 0) -> Gaussians:
    """Return splats of a body of 1 m radius in the middle of a room of 5 m radius; any number of them."""
    rng = np.random.default_rng(seed)
    walls = int(ROOM_SHARE * count)
    body, room = count - walls, walls
    normals = _directions(count, rng)
    bumps = 1.0 + 0.15 * np.sin(5.0 * normals[:, 0]) * np.sin(4.0 * normals[:, 1] + 1.0)
    radii = np.where(np.arange(count) < body, BODY_RADIUS * bumps, ROOM_RADIUS)
    means = radii[:, None] * normals
    # As far apart as neighbors are: a layer of them is closed. Real scenes have many small and few large.
    spacings = np.where(
        np.arange(count) < body,
        BODY_RADIUS * np.sqrt(4.0 * np.pi / max(body, 1)),
        ROOM_RADIUS * np.sqrt(4.0 * np.pi / max(room, 1)),
    )
    scales = 0.8 * spacings[:, None] * np.exp(0.6 * rng.normal(size=(count, 3)))
    scales[:, 2] *= 0.15
    sh = 0.05 * rng.normal(size=(count, coefficient_count(DEGREE), 3))
    sh[:, 0] = sh_from_rgb(_texture(means) + 0.05 * rng.normal(size=(count, 3)))
    return Gaussians(
        means=means,
        log_scales=np.log(scales),
        quats=_quats_with_axis(normals, rng),
        opacity_logits=rng.normal(0.5, 2.0, count),
        sh=sh,
    )


def filtered(scene: Gaussians, camera: Camera) -> Gaussians:
    """Return splats that are not thinner than the pixels of a view, as a training leaves them.

    The gradient of a thinner one is mostly rounding.
    """
    means = wp.array(scene.means, dtype=wp.vec3, device="cpu")
    distances = sampling_distances(means, [camera]).numpy()
    added = VARIANCE * np.square(distances)[:, None]
    return replace(scene, log_scales=0.5 * np.log(np.exp(2.0 * scene.log_scales) + added))


def perturbed(scene: Gaussians, seed: int = 1) -> Gaussians:
    """Return a start that a training can bring back to the scene: gray, rounder, and moved a little."""
    rng = np.random.default_rng(seed)
    count = len(scene)
    smallest = np.exp(scene.log_scales).max(axis=1, keepdims=True)
    sh = np.zeros_like(scene.sh)
    sh[:, 0] = 0.5 * scene.sh[:, 0]
    return Gaussians(
        means=scene.means + 0.3 * smallest * rng.normal(size=(count, 3)),
        log_scales=np.maximum(scene.log_scales, np.log(0.3 * smallest)),
        quats=scene.quats + 0.2 * rng.normal(size=(count, 4)),
        opacity_logits=np.full(count, 1.0),
        sh=sh,
    )


def cameras(count: int, width: int, height: int) -> list[Camera]:
    """Return cameras around the body that look at it; principal points are off-center."""
    focal = 0.9 * max(width, height)
    intrinsics = Intrinsics(width, height, focal, 1.02 * focal, 0.49 * width, 0.52 * height)
    turns = 2.0 * np.pi * np.arange(count) / count
    eyes = EXTENT * np.stack([np.cos(turns), np.sin(turns), 0.4 * np.cos(3.0 * turns)], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    return [Camera(intrinsics, look_at(eye, np.zeros(3), up)) for eye in eyes]


def _directions(count: int, rng: np.random.Generator) -> np.ndarray:
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _texture(points: np.ndarray) -> np.ndarray:
    """Return smooth colors with edges, (n, 3), 0.1 .. 0.9."""
    x, y, z = np.moveaxis(points, 1, 0)
    checks = np.sign(np.sin(9.0 * x) * np.sin(9.0 * y) * np.sin(9.0 * z))
    waves = np.stack([np.sin(4.0 * x + y), np.sin(5.0 * y + 2.0), np.sin(3.0 * z - x)], axis=1)
    return 0.5 + 0.25 * waves + 0.15 * checks[:, None]


def _quats_with_axis(axes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return rotations, xyzw, that turn z to ``axes`` (n, 3), and about it by any angle."""
    other = np.cross(axes, rng.normal(size=axes.shape))
    first = other / np.linalg.norm(other, axis=1, keepdims=True)
    rotations = np.stack([first, np.cross(axes, first), axes], axis=2)
    return quat_xyzw_from_matrix(rotations)
