"""The sensor's extra rays against closed forms: what the right eye sees, mirrors, what lies behind."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.render.rays import SurfaceRays
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Material, Scene
from reference.plates import plate

UP = np.array([0.0, 0.0, 1.0])
INTRINSICS = Intrinsics.from_fov(160, 90, 60.0)
SKY = Environment(np.ones((8, 16, 3), np.float32))
BASELINE = 0.12
ALL = np.ones((90, 160), bool)
GLASS = Material("glass", np.ones(3, np.float32), transmission=1.0, roughness=0.0)
# One metre in front of the origin, looking along -x: image right is +y.
CAMERA = Camera(INTRINSICS, look_at(np.array([1.0, 0, 0]), np.zeros(3), UP))


def wall(x: float, half: float, **material: object) -> Scene:
    """A square plate at ``x`` that faces the camera, +- ``half`` metres."""
    surface = replace(Material("wall", np.full(3, 0.5, np.float32)), **material)
    return plate((x, 0, 0), (0, half, 0), (0, 0, half), surface)


def rays_of(scene: Scene) -> tuple[SurfaceRays, np.ndarray]:
    renderer = RaycastRenderer(scene, SKY)
    return renderer.frame_rays(CAMERA, BASELINE), renderer.render_geometry(CAMERA)[0]


def test_a_plate_hides_from_the_right_eye_what_its_disparity_covers() -> None:
    """The shadow zone lies left of the plate and is as wide as the step in disparity."""
    rays, depth = rays_of(join_scenes(wall(0.4, 0.1), wall(-0.5, 3.0)))
    hidden = ~rays.right_visibility(ALL, depth)
    near, far = INTRINSICS.fx * BASELINE / 0.6, INTRINSICS.fx * BASELINE / 1.5
    row = hidden[45]
    plate_columns = np.flatnonzero(depth[45] < 0.7)
    columns = np.flatnonzero(row)
    assert abs(len(columns) - (near - far)) <= 1
    assert columns.max() == plate_columns.min() - 1  # adjoining, and in one piece
    assert np.ptp(columns) == len(columns) - 1
    # Above and below the plate nothing is hidden.
    rows = np.flatnonzero((depth < 0.7).any(axis=1))
    assert not hidden[: rows.min()].any() and not hidden[rows.max() + 1 :].any()


def test_a_mirror_at_the_origin_shows_the_surround_at_its_distance() -> None:
    rays, depth = rays_of(wall(0.0, 0.2))
    distance = rays.reflection_distance(ALL)
    hit = depth < 1.01
    points = CAMERA.unproject(pixel_centers(160, 90), depth)
    arriving = points - CAMERA.center_world
    arriving /= np.linalg.norm(arriving, axis=-1, keepdims=True)
    leaving = arriving * (-1, 1, 1)
    end = points + leaving * distance[..., None]
    np.testing.assert_allclose(np.linalg.norm(end, axis=-1)[hit], SKY.radius, rtol=1e-4)
    assert (distance[~hit] == 0).all() and hit.sum() > 1000


def test_a_mirror_shows_the_wall_behind_the_camera() -> None:
    rays, depth = rays_of(join_scenes(wall(0.0, 0.2), wall(1.5, 3.0)))
    arriving = CAMERA.unproject(pixel_centers(160, 90), depth) - CAMERA.center_world
    along = arriving[..., 0] / np.linalg.norm(arriving, axis=-1)
    hit = depth < 1.01
    np.testing.assert_allclose(rays.reflection_distance(ALL)[hit], (1.5 / -along)[hit], rtol=1e-3)


@pytest.mark.parametrize("layers", [1, 2, 6])
def test_depth_behind_looks_through_every_layer_of_glass(layers: int) -> None:
    panes = [wall(0.5 - 0.02 * i, 0.1, transmission=1.0) for i in range(layers)]
    rays, depth = rays_of(join_scenes(*panes, wall(-0.5, 3.0)))
    assert depth.min() == pytest.approx(0.5, rel=1e-5)
    np.testing.assert_allclose(rays.depth_behind(ALL), 1.5, rtol=1e-5)


def test_behind_glass_alone_lies_the_surround_and_behind_walls_nothing() -> None:
    rays, depth = rays_of(wall(0.0, 0.2, opacity=0.3))
    far = RaycastRenderer(wall(-0.5, 0.001), SKY).render_geometry(CAMERA)[0]
    np.testing.assert_allclose(rays.depth_behind(ALL)[44:46, 60:100], far[44:46, 60:100], rtol=1e-5)
    rays, depth = rays_of(wall(0.0, 0.2))
    np.testing.assert_allclose(rays.depth_behind(ALL), depth, rtol=1e-6)


def test_opacity_textures_cut_holes_into_geometry() -> None:
    """Left half of the plate is cut out: depth, mask and rays pass there."""
    texture = np.repeat(np.where(np.arange(64) < 32, 0, 255)[None], 64, axis=0).astype(np.uint8)
    leaf = wall(0.0, 0.2, opacity_texture=texture, alpha_cutoff=0.5, opacity=0.5)
    renderer = RaycastRenderer(join_scenes(leaf, wall(-0.5, 3.0)), SKY)
    depth, _, materials, _ = renderer.render_geometry(CAMERA)
    row = depth[45]
    assert set(np.round(row, 4)) == {1.0, 1.5}
    (u, _), _ = CAMERA.project(np.array([0, 0, 0.0]))
    left, right = CAMERA.project(np.array([[0, -0.2, 0], [0, 0.2, 0]]))[0][:, 0]
    solid = np.flatnonzero(row < 1.2)
    assert abs(solid.min() - u) <= 1.5 and abs(solid.max() - max(left, right)) <= 1.5
    assert (materials[45][solid] == 0).all()


def test_rays_at_some_pixels_are_those_of_the_whole_frame() -> None:
    rays, depth = rays_of(join_scenes(wall(0.4, 0.1, transmission=1.0), wall(-0.5, 0.6)))
    where = np.random.default_rng(0).random((90, 160)) < 0.2
    for kind, elsewhere in (
        (lambda some: rays.right_visibility(some, depth), True),
        (rays.reflection_distance, np.nan),
        (rays.depth_behind, np.nan),
    ):
        some, everything = kind(where), kind(ALL)
        np.testing.assert_array_equal(some[where], everything[where])
        np.testing.assert_array_equal(some[~where], elsewhere)
        assert kind(np.zeros_like(where)).shape == where.shape  # asking for nothing is no error
