"""The ray caster against closed forms: depth, normals, masks, stereo, filtering, determinism."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.camera import Camera, Intrinsics, pixel_centers
from digs_warp.checks import DigsError
from digs_warp.geometry import look_at
from digs_warp.sim.environment import DEFAULT_RADIUS, Environment
from digs_warp.sim.join import join_scenes
from digs_warp.sim.panorama import panorama_directions
from digs_warp.sim.render.openness import openness_nodes
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene import Material, Scene
from reference.plates import plate

UP = np.array([0.0, 0.0, 1.0])
INTRINSICS = Intrinsics.from_fov(161, 91, 60.0)
CAMERA = Camera(INTRINSICS, look_at(np.array([1.1, -0.5, 0.4]), np.zeros(3), UP))
GREY = Material("gray", np.full(3, 0.5, np.float32))


def sky(seed: int = 0, radius: float = DEFAULT_RADIUS) -> Environment:
    noise = np.random.default_rng(seed).uniform(0.2, 1.8, (32, 64, 3)).astype(np.float32)
    return Environment(noise, radius)


def gray_sky() -> Environment:
    return Environment(np.ones((16, 32, 3), np.float32))


def quad(
    center: np.ndarray,
    right: np.ndarray,
    up: np.ndarray,
    material: Material = GREY,
    repeat: float = 1.0,
) -> Scene:
    """A parallelogram, center +- right +- up, seen from its front (right x up)."""
    corners = np.array(
        [center - right - up, center + right - up, center + right + up, center - right + up]
    )
    normal = np.cross(right, up) / np.linalg.norm(np.cross(right, up))
    return Scene(
        vertices=corners.astype(np.float32),
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        face_materials=np.zeros(2, np.int32),
        normals=np.tile(normal, (4, 1)).astype(np.float32),
        uvs=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32) * np.float32(repeat),
        vertex_colors=np.ones((4, 3), np.float32),
        materials=(material,),
    )


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
    return Scene(
        vertices=(radius * normals).astype(np.float32),
        faces=faces.astype(np.int32),
        face_materials=np.zeros(len(faces), np.int32),
        normals=normals.astype(np.float32),
        uvs=np.zeros((len(normals), 2), np.float32),
        vertex_colors=np.ones((len(normals), 3), np.float32),
        materials=(GREY,),
    )


def rays_world(camera: Camera) -> np.ndarray:
    """Rays through the pixel centers with z_cam = 1, shape (height, width, 3), float64."""
    k = camera.intrinsics
    px = pixel_centers(k.width, k.height)
    return camera.unproject(px, np.ones(px.shape[:2])) - camera.center_world


def sphere_depth(camera: Camera, radius: float) -> np.ndarray:
    """Planar depth of the near side of a sphere round the origin, NaN where it is missed."""
    rays, eye = rays_world(camera), camera.center_world
    a, b = (rays**2).sum(-1), rays @ eye
    root = b * b - a * (eye @ eye - radius**2)
    return np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / a, np.nan)


FAR_AWAY = quad(np.array([0, 0, -3.9]), np.array([0.01, 0, 0]), np.array([0, 0.01, 0]))


def test_rays_along_the_sides_of_boxes_meet_what_is_there() -> None:
    # Zeros in directions, on the sides of the boxes of a grid of quads: 0 times infinity is NaN.
    forward, right, up = -np.eye(3)[0], np.eye(3)[1], np.eye(3)[2]
    places = [(y, z) for y in (-0.15, -0.05, 0.05, 0.15) for z in (-0.15, -0.05, 0.05, 0.15)]
    scene = join_scenes(*(quad(np.array([0.0, y, z]), 0.05 * right, 0.05 * up) for y, z in places))
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
    view = RaycastRenderer(quad(np.zeros(3), 3 * right, 3 * np.cross(normal, right)), sky()).render(
        CAMERA
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


def test_the_surround_has_the_depth_of_its_sphere() -> None:
    view = RaycastRenderer(FAR_AWAY, sky(radius=2.5)).render(CAMERA)
    rays, eye = rays_world(CAMERA), CAMERA.center_world
    a, b = (rays**2).sum(-1), rays @ eye
    expected = (-b + np.sqrt(b * b - a * (eye @ eye - 2.5**2))) / a
    np.testing.assert_allclose(view.depth, expected, rtol=1e-5)
    assert (view.material_ids == -1).all() and not view.mask.any()
    points = CAMERA.unproject(pixel_centers(161, 91), expected)
    np.testing.assert_allclose(view.normals_world, -points / 2.5, atol=1e-5)


def test_the_surround_shows_the_panorama_where_it_lies() -> None:
    directions = panorama_directions(256, 128)
    renderer = RaycastRenderer(FAR_AWAY, Environment((directions + 1).astype(np.float32) / 2))
    camera = Camera(INTRINSICS, CAMERA.world_from_cam)
    depth = renderer.render_geometry(camera).depth
    outward = camera.unproject(pixel_centers(161, 91), depth) / 4.0
    image, _ = renderer.render_image(camera, samples_per_pixel=64)
    linear = np.where(image <= 10, image / 255 / 12.92, ((image / 255 + 0.055) / 1.055) ** 2.4)
    expected = np.clip((outward + 1) / 2 * renderer.exposure, 0, 1)
    assert np.abs(linear - expected).max() < 0.012


def test_a_camera_outside_the_surround_is_refused() -> None:
    renderer = RaycastRenderer(FAR_AWAY, sky(radius=1.0))
    with pytest.raises(DigsError, match="outside the surround of radius 1 m"):
        renderer.render(CAMERA)


def test_mask_is_the_covered_share_of_the_image() -> None:
    camera = Camera(INTRINSICS, look_at(np.array([1.0, 0, 0]), np.zeros(3), UP))
    scene = quad(np.zeros(3), np.array([0, 0.213, 0]), np.array([0, 0, 0.137]))
    _, mask = RaycastRenderer(scene, sky()).render_image(camera, samples_per_pixel=16)
    covered = 4 * 0.213 * 0.137 * INTRINSICS.fx * INTRINSICS.fy
    assert mask.sum() / 255 == pytest.approx(covered, rel=2e-3)
    assert set(np.unique(mask)) <= {int(255 * i / 16 + 0.5) for i in range(17)}


def test_both_eyes_see_the_same_points_at_the_disparity_of_their_depth() -> None:
    renderer = RaycastRenderer(sphere(0.3, 128), sky())
    right = CAMERA.shifted_right(0.12)
    depth, normals = renderer.render_geometry(CAMERA)[:2]
    points = CAMERA.unproject(pixel_centers(161, 91), depth)
    px_right, _ = right.project(points)
    disparity = pixel_centers(161, 91)[..., 0] - px_right[..., 0]
    np.testing.assert_allclose(disparity, INTRINSICS.fx * 0.12 / depth, rtol=1e-6)
    # The sphere is convex: what faces both eyes is seen by both, in the same row.
    facing = [((eye.center_world - points) * normals).sum(-1) > 0.6 for eye in (CAMERA, right)]
    both = facing[0] & facing[1] & (np.linalg.norm(points, axis=-1) < 0.31)
    assert both.sum() > 500
    u, row = px_right[both][:, 0] - 0.5, np.round(px_right[both][:, 1] - 0.5).astype(int)
    column = np.floor(u).astype(int)
    seen = renderer.render_geometry(right).depth
    between = seen[row, column] * (column + 1 - u) + seen[row, column + 1] * (u - column)
    np.testing.assert_allclose(between, depth[both], atol=2e-4)


def test_the_order_of_triangles_does_not_matter() -> None:
    scene = sphere(0.3, 24)
    order = np.random.default_rng(0).permutation(len(scene.faces))
    shuffled = replace(scene, faces=scene.faces[order], face_materials=scene.face_materials[order])
    one = RaycastRenderer(scene, sky()).render(CAMERA)
    other = RaycastRenderer(shuffled, sky()).render(CAMERA)
    np.testing.assert_allclose(one.depth, other.depth, rtol=1e-6)
    np.testing.assert_array_equal(one.mask, other.mask)
    assert np.abs(one.image.astype(int) - other.image).max() <= 1


def test_faces_wound_against_their_normals_look_the_same() -> None:
    scene = sphere(0.3, 24)
    reversed_faces = replace(scene, faces=scene.faces[:, ::-1].copy())
    one, other = (RaycastRenderer(s, sky()).render(CAMERA) for s in (scene, reversed_faces))
    np.testing.assert_allclose(one.normals_world, other.normals_world, atol=1e-5)
    assert np.abs(one.image.astype(int) - other.image).max() <= 1


def test_threads_and_earlier_frames_do_not_change_a_bit() -> None:
    scene = replace(sphere(0.3, 24), materials=(replace(GREY, roughness=0.3),))
    serial, pooled = (RaycastRenderer(scene, sky(), threads) for threads in (1, 2))
    other = Camera(INTRINSICS, look_at(np.array([0.2, 1.0, 0.1]), np.zeros(3), UP))
    first = serial.render(CAMERA, seed=7)
    pooled.render(other, seed=8)
    again = pooled.render(CAMERA, seed=7)
    for name in ("image", "mask", "depth", "normals_world", "material_ids"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    assert not np.array_equal(first.image, serial.render(CAMERA, seed=8).image)


def test_white_furnace_returns_the_color_of_a_matte_surface() -> None:
    """Light from everywhere: a matte convex object shows its own color, plus the coat's few percent."""
    scene = replace(sphere(0.3), materials=(replace(GREY, base_color=np.array([0.8, 0.4, 0.1])),))
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


def test_both_sides_of_a_sheet_are_lit_alike() -> None:
    scene = quad(np.zeros(3), np.array([0, 0.3, 0]), np.array([0, 0, 0.3]))
    renderer = RaycastRenderer(scene, gray_sky())
    images, normals = [], []
    for x in (1.0, -1.0):
        camera = Camera(INTRINSICS, look_at(np.array([x, 0, 0]), np.zeros(3), UP))
        images.append(renderer.render_image(camera)[0][45, 80])
        normals.append(renderer.render_geometry(camera).normals_world[45, 80])
    np.testing.assert_array_equal(images[0], images[1])
    np.testing.assert_allclose(normals, [[1, 0, 0], [-1, 0, 0]], atol=1e-6)


def test_zero_vertex_normals_fall_back_to_the_triangle() -> None:
    scene = quad(np.zeros(3), np.array([0, 0.3, 0]), np.array([0, 0, 0.3]))
    blank = replace(scene, normals=np.zeros_like(scene.normals))
    camera = Camera(INTRINSICS, look_at(np.array([1.0, 0, 0]), np.zeros(3), UP))
    one, other = (RaycastRenderer(s, sky()).render(camera) for s in (scene, blank))
    np.testing.assert_allclose(one.normals_world, other.normals_world, atol=1e-6)
    assert other.image[45, 80].min() > 0


def test_a_corner_is_darker_than_an_open_surface() -> None:
    floor = quad(np.zeros(3), np.array([0.3, 0, 0]), np.array([0, 0.3, 0]))
    wall = quad(np.array([-0.3, 0, 0.3]), np.array([0, 0.3, 0]), np.array([0, 0, 0.3]))
    corner = replace(
        floor,
        vertices=np.concatenate([floor.vertices, wall.vertices]),
        normals=np.concatenate([floor.normals, wall.normals]),
        uvs=np.concatenate([floor.uvs, wall.uvs]),
        vertex_colors=np.ones((8, 3), np.float32),
        faces=np.concatenate([floor.faces, wall.faces + 4]).astype(np.int32),
        face_materials=np.zeros(4, np.int32),
    )
    camera = Camera(INTRINSICS, look_at(np.array([0.4, 0, 0.8]), np.zeros(3), UP))
    alone, beside = (
        RaycastRenderer(s, gray_sky()).render_image(camera)[0] for s in (floor, corner)
    )
    (u, v), _ = camera.project(np.array([-0.25, 0.0, 0.0]))
    assert beside[int(v), int(u), 0] < 0.9 * alone[int(v), int(u), 0]


def test_the_middle_of_a_large_face_is_bright_between_dark_corners() -> None:
    """The floor of a tray is two triangles; their corners alone say nothing about the middle."""
    gray = Material("gray", np.full(3, 0.5))
    floor = plate((0, 0, 0), (0.3, 0, 0), (0, 0.3, 0), gray)
    rims = [
        plate(center, along, (0, 0, 0.1), gray)
        for center, along in (
            ((-0.3, 0, 0.1), (0, 0.3, 0)),
            ((0.3, 0, 0.1), (0, 0.3, 0)),
            ((0, -0.3, 0.1), (0.3, 0, 0)),
            ((0, 0.3, 0.1), (0.3, 0, 0)),
        )
    ]
    camera = Camera(INTRINSICS, look_at(np.array([0.05, 0, 0.9]), np.zeros(3), UP))
    bare, tray = (
        RaycastRenderer(s, gray_sky()).render_image(camera)[0][45, 80, 0]
        for s in (floor, join_scenes(floor, *rims))
    )
    assert 0.85 * bare < tray < bare


def test_nodes_lie_on_vertices_and_edges_and_point_to_their_largest_face() -> None:
    scene = plate((0, 0, 0), (1, 0, 0), (0, 1, 0), Material("floor", np.full(3, 0.5)))
    nodes = openness_nodes(scene)
    assert len(nodes.points) == 4 + 5 and nodes.edges.shape == (2, 3)
    for face, edges in zip(scene.faces, nodes.edges, strict=True):
        corners = scene.vertices[face]
        np.testing.assert_allclose(nodes.points[edges], (corners + np.roll(corners, -1, 0)) / 2)
    middles = scene.vertices[scene.faces].mean(axis=1)
    ends = nodes.points + nodes.inward
    assert np.abs(ends[:, None] - middles).sum(axis=2).min(axis=1).max() < 1e-6
    np.testing.assert_allclose(np.linalg.norm(nodes.normals, axis=1), 1, rtol=1e-6)


def checkered_wall(square: int) -> Scene:
    """A wall of 1.6 x 1.6 m in the plane x = 0 with 2048 x 2048 texels, in squares of some texels."""
    squares = np.indices((256 // square, 256 // square)).sum(axis=0) % 2
    texture = np.kron(squares[..., None] * [255, 255, 255], np.ones((square, square, 1)))
    material = Material("checkers", np.ones(3, np.float32), texture.astype(np.uint8))
    return quad(np.zeros(3), np.array([0, 0.8, 0]), np.array([0, 0, 0.8]), material, repeat=8.0)


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
    image, _ = renderer.render_image(camera, samples_per_pixel=16)
    # Squares of 22 pixels: nearly every pixel is black or white.
    gray = image[..., 0].astype(int)
    dark, bright = gray.min(), gray.max()
    assert bright > dark + 100
    between = (gray > dark + 0.2 * (bright - dark)) & (gray < bright - 0.2 * (bright - dark))
    assert between.mean() < 0.15


def test_texture_lies_upright_and_unmirrored() -> None:
    colors = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
    texture = np.kron(colors, np.ones((32, 32, 1), np.uint8))
    scene = quad(
        np.zeros(3), np.array([0, 0.3, 0]), np.array([0, 0, 0.3]), replace(GREY, texture=texture)
    )
    camera = Camera(INTRINSICS, look_at(np.array([1.0, 0, 0]), np.zeros(3), UP))
    image, _ = RaycastRenderer(scene, gray_sky()).render_image(camera)
    (left, top), (right, bottom) = (60, 25), (100, 65)
    assert image[top, left].argmax() == 0 and image[top, right].argmax() == 1
    assert image[bottom, left].argmax() == 2 and np.ptp(image[bottom, right].astype(int)) < 8


@pytest.mark.parametrize(("width", "height", "samples"), [(1, 1, 1), (17, 3, 5), (1, 9, 2)])
def test_odd_image_sizes_and_sample_counts(width: int, height: int, samples: int) -> None:
    intrinsics = Intrinsics(width, height, 200.0, 200.0, width / 2, height / 2)
    camera = Camera(intrinsics, CAMERA.world_from_cam)
    view = RaycastRenderer(sphere(0.3, 8), sky()).render(camera, samples)
    assert view.image.shape == (height, width, 3) and view.mask.shape == (height, width)
    assert view.mask[height // 2, width // 2] == 255 and np.isfinite(view.depth).all()


def test_no_samples_are_refused() -> None:
    with pytest.raises(DigsError, match="samples_per_pixel: 0"):
        RaycastRenderer(FAR_AWAY, sky()).render(CAMERA, samples_per_pixel=0)
