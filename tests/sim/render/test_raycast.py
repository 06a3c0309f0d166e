"""The ray caster against closed forms: geometry, masks, determinism, light and textures."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
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

FAR_AWAY = plate((0, 0, -3.9), (0.01, 0, 0), (0, 0.01, 0), GRAY)


def sphere_depth(camera: Camera, radius: float) -> np.ndarray:
    """Planar depth of the near side of a sphere round the origin, NaN where it is missed."""
    rays, eye = rays_world(camera), camera.center_world
    a, b = (rays**2).sum(-1), rays @ eye
    root = b * b - a * (eye @ eye - radius**2)
    return np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / a, np.nan)


def test_rays_along_the_sides_of_boxes_meet_what_is_there() -> None:
    # Zeros in directions, on the sides of the boxes of a grid of quads: 0 times infinity is NaN.
    forward, right, up = -np.eye(3)[0], np.eye(3)[1], np.eye(3)[2]
    places = [(y, z) for y in (-0.15, -0.05, 0.05, 0.15) for z in (-0.15, -0.05, 0.05, 0.15)]
    scene = join_scenes(*(plate((0.0, y, z), 0.05 * right, 0.05 * up, GRAY) for y, z in places))
    k = Intrinsics.from_fov(9, 9, 8.0)
    camera = Camera(k, look_at(np.array([1.0, 0.0, 0.0]), np.zeros(3), UP))
    renderer = RaycastRenderer(scene, gray_sky())
    directions = camera.world_from_cam[:3, :3] @ np.array([0.0, 0.0, 1.0])
    assert np.array_equal(directions, forward)
    np.testing.assert_allclose(renderer.render_geometry(camera).depth, 1.0, atol=1e-6)
    image, mask = renderer.render_image(camera, samples_per_pixel=16)
    assert (mask == 255).all()
    assert np.ptp(image.reshape(-1, 3)[:, 0].astype(int)) <= 8


def test_depth_of_a_slanted_plane_is_the_closed_form() -> None:
    normal = np.array([0.8, -0.5, 0.33]) / np.linalg.norm([0.8, -0.5, 0.33])
    right = np.cross(UP, normal)
    view = see(
        RaycastRenderer(plate((0, 0, 0), 3 * right, 3 * np.cross(normal, right), GRAY), sky()),
        CAMERA,
    )
    expected = -(CAMERA.center_world @ normal) / (rays_world(CAMERA) @ normal)
    hit = view.material_ids == 0
    assert hit.all()
    np.testing.assert_allclose(view.depth, expected, rtol=1e-5)
    np.testing.assert_allclose(view.normals_world, np.broadcast_to(normal, (91, 161, 3)), atol=1e-6)


def test_depth_and_normals_of_a_sphere() -> None:
    radius = 0.3
    depth, normals, materials, _ = RaycastRenderer(sphere(radius, 128), sky()).render_geometry(
        CAMERA
    )
    expected = sphere_depth(CAMERA, radius)
    k = INTRINSICS
    points = CAMERA.unproject(pixel_centers(k.width, k.height), expected)
    facing = -(rays_world(CAMERA) * points).sum(-1) / (
        np.linalg.norm(rays_world(CAMERA), axis=-1) * radius
    )
    inner = facing > 0.3  # at the limb the flat facets stand out
    assert (materials[inner] == 0).all() and inner.sum() > 1000
    # Facets lie inside the sphere by up to r (1 - cos(pi / 256)) * 2 / facing = 1.5e-4 m.
    np.testing.assert_allclose(depth[inner], expected[inner], atol=1.5e-4)
    np.testing.assert_allclose(normals[inner], points[inner] / radius, atol=2e-3)


def test_mask_is_the_covered_share_of_the_image() -> None:
    camera = Camera(INTRINSICS, look_at(np.array([1.0, 0, 0]), np.zeros(3), UP))
    scene = plate((0, 0, 0), (0, 0.213, 0), (0, 0, 0.137), GRAY)
    _, mask = RaycastRenderer(scene, sky()).render_image(camera, samples_per_pixel=16)
    covered = 4 * 0.213 * 0.137 * INTRINSICS.fx * INTRINSICS.fy
    assert mask.sum() / 255 == pytest.approx(covered, rel=2e-3)
    assert set(np.unique(mask)) <= {int(255 * i / 16 + 0.5) for i in range(17)}


def test_threads_and_earlier_frames_do_not_change_a_bit() -> None:
    scene = replace(sphere(0.3, 24), materials=(replace(GRAY, roughness=0.3),))
    serial, pooled = (RaycastRenderer(scene, sky(), threads) for threads in (1, 2))
    other = Camera(INTRINSICS, look_at(np.array([0.2, 1.0, 0.1]), np.zeros(3), UP))
    first = see(serial, CAMERA, seed=7)
    see(pooled, other, seed=8)
    again = see(pooled, CAMERA, seed=7)
    for name in ("image", "mask", "depth", "normals_world", "material_ids"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    assert not np.array_equal(first.image, see(serial, CAMERA, seed=8).image)


def test_four_samples_are_near_to_many() -> None:
    texture = np.random.default_rng(0).integers(60, 200, (64, 64, 3)).astype(np.uint8)
    leaning = plate((0, 0, 0), (0.05, 0.3, 0.05), (0, -0.1, 0.3), replace(GRAY, texture=texture))
    renderer = RaycastRenderer(leaning, gray_sky())
    many, covered = renderer.render_image(CAMERA, samples_per_pixel=400, seed=1)
    few, mask = renderer.render_image(CAMERA, samples_per_pixel=4)
    edge = (covered > 0) & (covered < 255)
    assert edge.sum() > 300
    assert np.std(mask[edge] / 255.0 - covered[edge] / 255.0) < 0.11  # at random places: .13
    assert np.std(few[covered == 255].astype(float) - many[covered == 255]) < 1.5


@pytest.mark.parametrize(("width", "height", "samples"), [(1, 1, 1), (17, 3, 5), (1, 9, 2)])
def test_odd_image_sizes_and_sample_counts(width: int, height: int, samples: int) -> None:
    intrinsics = Intrinsics(width, height, 200.0, 200.0, width / 2, height / 2)
    camera = Camera(intrinsics, CAMERA.world_from_cam)
    view = see(RaycastRenderer(sphere(0.3, 8), sky()), camera, samples)
    assert view.image.shape == (height, width, 3) and view.mask.shape == (height, width)
    assert view.mask[height // 2, width // 2] == 255 and np.isfinite(view.depth).all()


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
