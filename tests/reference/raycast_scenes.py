"""A camera, lights and round scenes for the tests of the ray caster."""

from typing import NamedTuple

import numpy as np

from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.environment import DEFAULT_RADIUS, Environment
from digs_warp.sim.scene.scene import Material, Scene
from reference.plates import scene_of

UP = np.array([0.0, 0.0, 1.0])
INTRINSICS = Intrinsics.from_fov(161, 91, 60.0)
CAMERA = Camera(INTRINSICS, look_at(np.array([1.1, -0.5, 0.4]), np.zeros(3), UP))
GRAY = Material("gray", np.full(3, 0.5, np.float32))


class View(NamedTuple):
    """Everything that one eye sees."""

    image: np.ndarray
    mask: np.ndarray
    depth: np.ndarray
    normals_world: np.ndarray
    material_ids: np.ndarray
    object_ids: np.ndarray


def see(renderer: RaycastRenderer, camera: Camera, samples: int = 4, seed: int = 0) -> View:
    """What a still camera sees."""
    taken = renderer.render_image(camera, samples, seed)
    return View(*taken, *renderer.render_geometry(camera))


def sky(seed: int = 0, radius: float = DEFAULT_RADIUS) -> Environment:
    """Light of random colors."""
    noise = np.random.default_rng(seed).uniform(0.2, 1.8, (32, 64, 3)).astype(np.float32)
    return Environment(noise, radius)


def gray_sky() -> Environment:
    """The same light from everywhere."""
    return Environment(np.ones((16, 32, 3), np.float32))


def sphere(radius: float, rings: int = 64) -> Scene:
    """A finely cut sphere round the origin."""
    polar, azimuth = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, 2 * rings + 1), indexing="ij"
    )
    normals = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1
    ).reshape(-1, 3)
    row = 2 * rings + 1
    a = (np.arange(rings)[:, None] * row + np.arange(2 * rings)).reshape(-1)
    faces = np.concatenate(
        [np.stack([a, a + row, a + row + 1], 1), np.stack([a, a + row + 1, a + 1], 1)]
    )
    points = normals[faces]
    area = np.linalg.norm(
        np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), axis=1
    )
    faces = faces[area > 1e-9]
    return scene_of(radius * normals, faces, normals, GRAY)


def rays_world(camera: Camera) -> np.ndarray:
    """Rays through the pixel centers with z_cam = 1, shape (height, width, 3), float64."""
    k = camera.intrinsics
    px = pixel_centers(k.width, k.height)
    return camera.unproject(px, np.ones(px.shape[:2])) - camera.center_world
