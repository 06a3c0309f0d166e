"""Masks and object numbers of scenes with several objects and furniture."""

from dataclasses import replace

import numpy as np

from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Material, Scene
from reference.plates import plate
from reference.raycast_scenes import see

SKY = Environment(np.ones((16, 32, 3), np.float32))
GREY = Material("gray", np.full(3, 0.5, np.float32))
# Looks along -x at the plane x = 0 from 1 m: 100 px per metre, the origin in the middle.
CAMERA = Camera(
    Intrinsics(80, 60, 100.0, 100.0, 40.0, 30.0),
    look_at(np.array([1.0, 0, 0]), np.zeros(3), np.array([0, 0, 1.0])),
)


def upright(x: float, y: float, half: float, material: Material = GREY) -> Scene:
    """A square that faces the camera, ``half`` a side, at height 0."""
    return plate((x, y, 0), (0, half, 0), (0, 0, half), material)


def furniture(scene: Scene) -> Scene:
    """The same triangles, as no object."""
    return replace(scene, face_objects=np.zeros(len(scene.faces), np.int32), objects=())


# Two squares of 20 px, 10 px left and right of the middle, before furniture of twice the height.
SCENE = join_scenes(
    upright(0.0, -0.2, 0.1), furniture(upright(-1e-3, 0.0, 0.2003)), upright(0.0, 0.2, 0.1)
)


def test_masks_and_numbers_tell_objects_from_furniture() -> None:
    view = see(RaycastRenderer(SCENE, SKY), CAMERA, 4)
    numbers = np.zeros((60, 80), np.int32)
    numbers[20:40, 10:30], numbers[20:40, 50:70] = 1, 2
    np.testing.assert_array_equal(view.object_ids, numbers)
    np.testing.assert_array_equal(view.mask, np.where(numbers > 0, 255, 0))
    assert (view.material_ids >= 0).sum() == 40 * 40 + 2 * 20 * 10  # furniture is there, too
    np.testing.assert_array_equal(view.depth[view.material_ids < 0] > 2, True)


def test_furniture_before_an_object_hides_it_unless_it_is_glass() -> None:
    behind = upright(0.0, 0.0, 0.1)
    glass = Material("glass", np.ones(3, np.float32), transmission=1.0, roughness=0.0)
    for material, seen in ((GREY, 0), (glass, 255)):
        front = furniture(upright(0.01, 0.0, 0.15, material))
        view = see(RaycastRenderer(join_scenes(behind, front), SKY), CAMERA, 4)
        assert (view.mask[21:39, 31:49] == seen).all()
        assert (view.mask == 255).sum() == (400 if seen else 0)
        assert not view.object_ids.any()  # depth, too, is that of the glass
