"""Light and texture in ray-cast photographs, against what follows from energy and geometry."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Material, Scene
from reference.plates import plate
from reference.raycast_scenes import (
    CAMERA,
    GRAY,
    INTRINSICS,
    UP,
    gray_sky,
    rays_world,
    see,
    sky,
    sphere,
)


def test_white_furnace_returns_the_color_of_a_matte_surface() -> None:
    """Light from everywhere: a matte convex object shows its own color, plus the coat's few percent."""
    scene = replace(sphere(0.3), materials=(replace(GRAY, base_color=np.array([0.8, 0.4, 0.1])),))
    renderer = RaycastRenderer(scene, gray_sky())
    image, mask = renderer.render_image(CAMERA, samples_per_pixel=16)
    normals = renderer.render_geometry(CAMERA).normals_world
    rays = rays_world(CAMERA)
    facing = -(rays / np.linalg.norm(rays, axis=-1, keepdims=True) * normals).sum(-1) > 0.7
    shown = image[(mask == 255) & facing].mean(axis=0) / 255
    linear = ((shown + 0.055) / 1.055) ** 2.4 / renderer.exposure
    assert (linear >= np.array([0.8, 0.4, 0.1]) - 0.01).all()
    assert (linear <= np.array([0.8, 0.4, 0.1]) + 0.05).all()


def test_a_perfect_mirror_in_a_white_furnace_disappears() -> None:
    mirror = Material("mirror", np.ones(3, np.float32), roughness=0.0, metallic=1.0)
    image, _ = RaycastRenderer(replace(sphere(0.3), materials=(mirror,)), gray_sky()).render_image(
        CAMERA, samples_per_pixel=4
    )
    assert np.ptp(image.astype(int)) <= 4


def test_both_sides_of_a_sheet_are_lit_the_same() -> None:
    scene = plate((0, 0, 0), (0, 0.3, 0), (0, 0, 0.3), GRAY)
    renderer = RaycastRenderer(scene, gray_sky())
    images, normals = [], []
    for x in (1.0, -1.0):
        camera = Camera(INTRINSICS, look_at(np.array([x, 0, 0]), np.zeros(3), UP))
        images.append(renderer.render_image(camera)[0][45, 80])
        normals.append(renderer.render_geometry(camera).normals_world[45, 80])
    np.testing.assert_array_equal(images[0], images[1])
    np.testing.assert_allclose(normals, [[1, 0, 0], [-1, 0, 0]], atol=1e-6)


def test_zero_vertex_normals_fall_back_to_the_triangle() -> None:
    scene = plate((0, 0, 0), (0, 0.3, 0), (0, 0, 0.3), GRAY)
    blank = replace(scene, normals=np.zeros_like(scene.normals))
    camera = Camera(INTRINSICS, look_at(np.array([1.0, 0, 0]), np.zeros(3), UP))
    one, other = (see(RaycastRenderer(s, sky()), camera) for s in (scene, blank))
    np.testing.assert_allclose(one.normals_world, other.normals_world, atol=1e-6)
    assert other.image[45, 80].min() > 0


def test_the_middle_of_a_large_face_is_bright_between_dark_corners() -> None:
    """The floor of a tray is two triangles; their corners alone say nothing about the middle."""
    floor = plate((0, 0, 0), (0.3, 0, 0), (0, 0.3, 0), GRAY)
    rims = [
        plate(center, along, (0, 0, 0.1), GRAY)
        for center, along in (
            ((-0.3, 0, 0.1), (0, 0.3, 0)),
            ((0.3, 0, 0.1), (0, 0.3, 0)),
            ((0, -0.3, 0.1), (0.3, 0, 0)),
            ((0, 0.3, 0.1), (0.3, 0, 0)),
        )
    ]
    camera = Camera(INTRINSICS, look_at(np.array([0.05, 0, 0.9]), np.zeros(3), UP))
    seen, _ = camera.project(np.array([[0.0, 0, 0], [-0.27, 0.27, 0]]))
    columns, rows = seen.astype(int).T
    (bare, open_corner), (tray, corner) = (
        RaycastRenderer(s, gray_sky()).render_image(camera)[0][rows, columns, 0]
        for s in (floor, join_scenes(floor, *rims))
    )
    assert 0.85 * bare < tray < bare
    assert corner < 0.87 * open_corner


def checkered_wall(square: int) -> Scene:
    """A wall of 1.6 x 1.6 m in the plane x = 0 with 2048 x 2048 texels, in squares of some texels."""
    squares = np.indices((256 // square, 256 // square)).sum(axis=0) % 2
    texture = np.kron(squares[..., None] * [255, 255, 255], np.ones((square, square, 1)))
    material = Material("checkers", np.ones(3, np.float32), texture.astype(np.uint8))
    return plate((0, 0, 0), (0, 0.8, 0), (0, 0, 0.8), material, repeat=8.0)


def test_texture_finer_than_a_pixel_does_not_shimmer() -> None:
    """Squares of a fifth of a pixel are an even gray, also when the camera moves."""
    renderer = RaycastRenderer(checkered_wall(square=4), gray_sky())
    for shift in (0.0, 0.004):
        camera = Camera(INTRINSICS, look_at(np.array([2.0, shift, 0]), np.array([0, shift, 0]), UP))
        image, mask = renderer.render_image(camera)
        wall = image[mask == 255].astype(int)
        assert len(wall) > 5000
        # Every second square is white: half the light, and the coat's few percent.
        half = ((wall.mean() / 255 + 0.055) / 1.055) ** 2.4
        assert 0.5 <= half / renderer.exposure <= 0.55
        assert wall.std() < 1.5 and np.ptp(wall) <= 8


def test_texture_near_by_is_sharp() -> None:
    renderer = RaycastRenderer(checkered_wall(square=16), gray_sky())
    camera = Camera(INTRINSICS, look_at(np.array([0.08, 0, 0]), np.zeros(3), UP))
    gray = renderer.render_image(camera, samples_per_pixel=16)[0][..., 0].astype(int)
    # Squares of 22 pixels: nearly every pixel is black or white.
    assert np.ptp(gray) > 100
    share = (gray - gray.min()) / np.ptp(gray)
    assert ((share > 0.2) & (share < 0.8)).mean() < 0.15


@pytest.mark.parametrize("emits", [False, True])
def test_texture_lies_upright_and_unmirrored(emits: bool) -> None:
    colors = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
    texture = np.kron(colors, np.ones((32, 32, 1), np.uint8))
    colored = replace(GRAY, texture=texture)
    if emits:
        colored = Material("glow", np.zeros(3), emission=(1, 1, 1), emission_texture=texture)
    scene = plate((0, 0, 0), (0, 0.3, 0), (0, 0, 0.3), colored)
    camera = Camera(INTRINSICS, look_at(np.array([1.0, 0, 0]), np.zeros(3), UP))
    image, _ = RaycastRenderer(scene, gray_sky()).render_image(camera)
    (left, top), (right, bottom) = (60, 25), (100, 65)
    assert image[top, left].argmax() == 0 and image[top, right].argmax() == 1
    assert image[bottom, left].argmax() == 2 and np.ptp(image[bottom, right].astype(int)) < 8
