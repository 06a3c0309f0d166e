"""Scenes whose shading has a closed form, and the cameras that look at them."""

import numpy as np

from digs_warp.data.images import linear_from_srgb
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.environment import Environment, panorama_directions
from digs_warp.sim.scene.scene import Material, Scene
from reference.plates import plate

UP = np.array([0.0, 0.0, 1.0])
INTRINSICS = Intrinsics.from_fov(160, 90, 60.0)
BLACK = Environment(np.zeros((16, 32, 3), np.float32))
WHITE = Environment(np.ones((16, 32, 3), np.float32))
MATTE = Material("matte", np.full(3, 0.5, np.float32))
# From the front (+x), one metre away, and from above at an angle.
FRONT = Camera(INTRINSICS, look_at(np.array([1.0, 0, 0]), np.zeros(3), UP))
ABOVE = Camera(INTRINSICS, look_at(np.array([0.8, 0, 0.8]), np.zeros(3), UP))


def wall(material: Material, x: float = 0.0, half: float = 0.3) -> Scene:
    return plate((x, 0, 0), (0, half, 0), (0, 0, half), material)


def floor(material: Material, z: float = 0.0, half: float = 0.4) -> Scene:
    return plate((0, 0, z), (half, 0, 0), (0, half, 0), material)


def glow(level: float) -> Material:
    """Black but for its own light."""
    return Material("glow", np.zeros(3, np.float32), emission=(level, level, level))


def sunny(sun: float = 70000.0, sky: float = 0.5) -> tuple[Environment, np.ndarray]:
    """An even sky with one bright texel; also the direction of that texel."""
    radiance = np.full((32, 64, 3), sky, np.float32)
    radiance[10, 20] = sun
    return Environment(radiance), panorama_directions(64, 32)[10, 20]


def linear_image(renderer: RaycastRenderer, camera: Camera, samples: int = 16) -> np.ndarray:
    return linear_from_srgb(renderer.render_image(camera, samples)[0] / 255.0)
