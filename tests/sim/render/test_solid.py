"""What rays to opaque surfaces need not meet: faces whose material is clear wherever they show it."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.render.upload import CELLS, stopping_faces
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Material, Scene
from reference.plates import plate

WHITE = np.ones(3, np.float32)
CLEAR = Material("clear", WHITE, transmission=1.0)
UP = np.array([0.0, 0.0, 1.0])


def half_clear(mirrored: bool = False, **material: object) -> Material:
    """Clear in the left half of the texture, opaque in the right one."""
    texture = np.repeat(np.where(np.arange(256) < 128, 255, 0)[None], 256, axis=0).astype(np.uint8)
    texture = texture[:, ::-1] if mirrored else texture
    return replace(Material("label", WHITE), transmission_texture=texture, **material)


def strip(material: Material, u0: float, u1: float, v: float = 0.5) -> Scene:
    """A plate that shows columns ``u0`` to ``u1`` of its texture."""
    scene = plate((0, 0, 0), (0, 1, 0), (0, 0, 1), material)
    uvs = scene.uvs.copy()
    uvs[:, 0] = np.where(uvs[:, 0] > 0.5, u1, u0)
    uvs[:, 1] = v
    return replace(scene, uvs=uvs)


@pytest.mark.parametrize(
    ("material", "stops"),
    [
        (Material("wall", WHITE), True),
        (CLEAR, False),
        (Material("tinted", WHITE, opacity=0.49), False),
        (Material("half", WHITE, opacity=0.5), True),
        (Material("milky", WHITE, transmission=0.5), True),
        (Material("hole", WHITE, opacity=0.8, alpha_cutoff=0.9), False),
    ],
)
def test_plain_materials_stop_rays_as_in_the_definition(material: Material, stops: bool) -> None:
    faces = stopping_faces(strip(material, 0.0, 1.0))
    assert len(faces) == 2 and (faces == stops).all()


@pytest.mark.parametrize(
    ("u0", "u1", "stops"),
    [
        (0.1, 0.4, False),
        (0.1, 0.49, True),  # as near to the opaque half as a cell
        (0.1, 0.6, True),
        (0.6, 0.9, True),
        (1.1, 1.4, False),  # textures repeat
        (-0.9, -0.6, False),
        (-0.2, 0.2, True),  # across the border
        (0.1, 5.0, True),
    ],
)
def test_textured_faces_stop_rays_where_they_show_an_opaque_part(
    u0: float, u1: float, stops: bool
) -> None:
    assert (stopping_faces(strip(half_clear(), u0, u1)) == stops).all()
    upside = half_clear().transmission_texture
    assert upside is not None
    turned = replace(half_clear(), transmission_texture=np.ascontiguousarray(upside.T))
    # The clear half is on top: v from 0.5 to 1.
    scene = strip(turned, 0.2, 0.3, v=0.75)
    assert not stopping_faces(scene).any()
    assert stopping_faces(strip(turned, 0.2, 0.3, v=0.25)).all()


def test_the_largest_opacity_counts() -> None:
    texture = np.full((512, 512), 30, np.uint8)
    texture[100, 200] = 200
    lens = replace(Material("lens", WHITE), opacity_texture=texture)
    around = 200 / 512
    assert stopping_faces(strip(lens, around, around + 0.001, v=1 - 100 / 512)).all()
    far = around + 3 / CELLS
    assert not stopping_faces(strip(lens, far, far + 0.001, v=1 - 100 / 512)).any()


def test_rays_find_the_same_with_and_without_the_faces_that_they_pass() -> None:
    """Panes before a labeled one, a small wall among them, and a wall behind."""
    panes = [plate((0.3 - 0.05 * i, 0, 0), (0, 0.3, 0), (0, 0, 0.2), CLEAR) for i in range(4)]
    label = plate((0.35, 0.05, 0.02), (0, 0.15, 0.02), (0, 0, 0.1), half_clear())
    wall = Material("wall", WHITE)
    small = plate((0.22, -0.1, 0), (0, 0.1, 0), (0, 0, 0.1), wall)
    scene = join_scenes(*panes, label, small, plate((-0.5, 0, 0), (0, 0.6, 0), (0, 0, 0.5), wall))
    camera = Camera(
        Intrinsics.from_fov(160, 90, 60.0), look_at(np.array([1.0, 0, 0]), np.zeros(3), UP)
    )
    renderer = RaycastRenderer(scene, Environment(np.ones((8, 16, 3), np.float32)))
    depth = renderer.render_geometry(camera)[0]
    rays = renderer.frame_rays(camera, 0.12)
    scene, everywhere = rays._scene, np.ones(depth.shape, bool)
    assert scene.solid is not scene
    behind, seen = rays.depth_behind(everywhere), rays.right_visibility(everywhere, depth)
    rays._scene = replace(scene)  # in which nothing is left out
    rays._scene.__dict__["solid"] = scene
    np.testing.assert_allclose(rays.depth_behind(everywhere), behind, rtol=1e-5)
    np.testing.assert_array_equal(rays.right_visibility(everywhere, depth), seen)
    assert len(np.unique(np.round(behind, 2))) >= 4  # label, small wall, wall, surround
    assert 0.02 < (~seen).mean() < 0.5
