"""The ray caster against closed forms: depth, normals, masks, stereo, determinism."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.join import join_scenes
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
