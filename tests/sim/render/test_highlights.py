"""Highlights of lamps, against the light in the lobe of the surface."""

import numpy as np
import pytest

from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.environment import Environment, panorama_directions, solid_angles
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Material, Scene
from reference.plates import plate
from reference.shading_scenes import INTRINSICS, MATTE, UP, floor, linear_image

GLOSS = Material("gloss", np.zeros(3, np.float32), roughness=0.4)
LAMPS = {"left": np.array([-0.35, 0.25, 0.9]), "right": np.array([-0.35, -0.25, 0.9])}
LAMP_HEIGHT = 64
TOWARD = np.array([0.35, 0.0, 0.9])  # to the camera: it sees the lobe midway between both lamps
SKY = 0.3


def texels(name: str) -> tuple[slice, slice]:
    """The four texels of a lamp."""
    directions = panorama_directions(2 * LAMP_HEIGHT, LAMP_HEIGHT)
    row, column = divmod(int((directions @ LAMPS[name]).argmax()), 2 * LAMP_HEIGHT)
    return slice(row, row + 2), slice(column, column + 2)


def lamps(*names: str) -> Environment:
    """An even sky with some of the lamps."""
    radiance = np.full((LAMP_HEIGHT, 2 * LAMP_HEIGHT, 3), SKY, np.float32)
    for name in names:
        radiance[texels(name)] = 2000.0
    return Environment(radiance)


def blind(name: str) -> Scene:
    """A plate 1 m away that hides a lamp from the origin."""
    toward = panorama_directions(2 * LAMP_HEIGHT, LAMP_HEIGHT)[texels(name)].mean(axis=(0, 1))
    return plate(tuple(toward / np.linalg.norm(toward)), (0.1, 0, 0), (0, 0.1, 0), MATTE)


def lobe_light(environment: Environment, mirrored: np.ndarray, roughness: float) -> float:
    """Mean over the GGX lobe, in double precision over every texel (Karis 2013, n = v = r)."""
    height = environment.radiance.shape[0]
    cosine = panorama_directions(2 * height, height) @ (mirrored / np.linalg.norm(mirrored))
    alpha2 = roughness**4
    weight = np.maximum(cosine, 0) / ((1 + cosine) / 2 * (alpha2 - 1) + 1) ** 2
    weight = weight * solid_angles(2 * height, height)
    return float((weight * environment.radiance[..., 0]).sum() / weight.sum())


@pytest.mark.parametrize("hidden", [("left",), ("left", "right")])
def test_a_lamp_in_the_shadow_has_no_highlight(hidden: tuple[str, ...]) -> None:
    both = lamps(*LAMPS)
    camera = Camera(INTRINSICS, look_at(TOWARD, np.zeros(3), UP))
    blinds = [blind(name) for name in hidden]
    renderer = RaycastRenderer(join_scenes(floor(GLOSS, half=0.1), *blinds), both)
    middle = linear_image(renderer, camera)[44:46, 79:81].mean()
    left_over = lamps(*(name for name in LAMPS if name not in hidden))
    mirrored = TOWARD * (-1, -1, 1)
    light, every = (lobe_light(each, mirrored, GLOSS.roughness) for each in (left_over, both))
    alone = RaycastRenderer(floor(GLOSS, half=0.1), both)
    plain = linear_image(alone, camera)[44:46, 79:81].mean()
    assert plain < 0.9  # not clipped
    assert middle == pytest.approx(plain * light / every, rel=0.1, abs=0.002)
    assert middle < 0.7 * plain
