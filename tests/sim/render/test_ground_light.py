"""Light and shadow on floors and tables, against closed forms of a ball that lies on them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh

from digs_warp.data.images import linear_from_srgb
from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.render.ground_light import measure_plane, planes_of
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.environment import Environment, panorama_directions, set_up
from digs_warp.sim.scene.scene import Material, Scene
from digs_warp.sim.scene.table import table_scene
from reference.plates import scene_of

RADIUS = 0.1
UP = np.array([0.0, 0.0, 1.0])
CAMERA = Camera(
    Intrinsics.from_fov(161, 121, 60.0), look_at(np.array([0.7, 0.2, 0.6]), -RADIUS * UP, UP)
)
GREY_SKY = Environment(np.full((64, 128, 3), 0.4, np.float32))


def ball(radius: float = RADIUS) -> Scene:
    """A ball around the origin."""
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=radius)
    gray = Material("gray", np.full(3, 0.5, np.float32))
    return scene_of(mesh.vertices, mesh.faces, mesh.vertices / radius, gray)


def sun(direction: np.ndarray, degrees: float, power: float = 1.0) -> Environment:
    """A gray sky with a bright disk; ``power``: its irradiance over that of the sky."""
    directions = panorama_directions(512, 256)
    inside = directions @ direction > np.cos(np.radians(degrees))
    strength = power / (1 - np.cos(np.radians(degrees)) ** 2)
    radiance = np.where(inside[..., None], 0.4 * (1 + strength), 0.4)
    return Environment(np.broadcast_to(radiance, (256, 512, 3)).astype(np.float32))


@cache
def under_grey_sky(ground: str) -> RaycastRenderer:
    """The renderer that several tests only read from."""
    return on(ground, GREY_SKY)


def on(ground: str, environment: Environment) -> RaycastRenderer:
    return RaycastRenderer(*set_up(ball(), environment, ground, 0.9)[:2])  # pyright: ignore


def openness_beside_ball(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Share of the sky beside a ball that lies on a plane: 1 minus its form factor cos(a) (R / d)^2."""
    distance = np.sqrt(x**2 + y**2 + RADIUS**2)
    return 1 - (RADIUS / distance) ** 3


def lit_floor(renderer: RaycastRenderer) -> tuple[np.ndarray, np.ndarray]:
    """Places on the floor in view, (n, 3), and their brightness over that of the open floor, (n,)."""
    image, mask = renderer.render_image(CAMERA, samples_per_pixel=16)
    seen = renderer.render_geometry(CAMERA)
    points = CAMERA.unproject(pixel_centers(161, 121), seen.depth)
    # The surround that shows nothing but sky: its brightness is known.
    floor = (mask == 0) & (seen.normals_world[..., 2] == 1) & (seen.material_ids == -1)
    linear = linear_from_srgb(image[floor] / 255.0)[:, 0]
    return points[floor], linear / (0.4 * renderer.exposure)


def test_a_ball_takes_the_light_of_its_form_factor_from_the_floor() -> None:
    points, share = lit_floor(under_grey_sky("floor"))
    expected = openness_beside_ball(points[:, 0], points[:, 1])
    assert expected.min() < 0.5 and expected.max() > 0.97
    # 128 rays, and grid cells as wide as a twentieth of the ball.
    np.testing.assert_allclose(share, expected, atol=0.03)
    assert abs((share - expected).mean()) < 0.005


def test_the_light_map_agrees_with_the_form_factor() -> None:
    renderer = under_grey_sky("table")
    floor, table = (
        measure_plane(renderer._surface, renderer._light, plane)
        for plane in (renderer._floor, renderer._table)
        if plane is not None
    )
    assert floor.height == pytest.approx(table.height - 0.75)
    for grid in (table.fine, table.coarse):
        values = grid.values.numpy()[..., 0]
        rows, columns = values.shape
        x = np.linspace(grid.low[0], grid.low[0] + grid.size[0], columns)[None]
        y = np.linspace(grid.low[1], grid.low[1] + grid.size[1], rows)[:, None]
        # Right beside the contact the rays start above the plane.
        away = np.hypot(x, y) > 0.3 * RADIUS
        errors = (values - openness_beside_ball(x, y))[away]
        # 128 rays.
        assert np.abs(errors).max() < 0.04 and abs(errors.mean()) < 0.006


def test_the_sun_casts_the_shadow_of_the_ball() -> None:
    toward = np.array([-0.5, 0.4, 0.0]) + 0.9 * UP
    toward /= np.linalg.norm(toward)
    renderer = on("floor", sun(toward, 2.0))
    assert renderer._light.keys.count == 1
    points, share = lit_floor(renderer)
    assert renderer._surface.floor.is_soft == 0
    along = points @ toward
    beside = np.linalg.norm(points - along[:, None] * toward, axis=1)
    openness = openness_beside_ball(points[:, 0], points[:, 1])
    blur = np.abs(along) * np.tan(np.radians(3.5)) + 0.01
    shadow, sunny = beside < RADIUS - blur, beside > RADIUS + blur
    assert shadow.sum() > 100
    # The sun gives its cosine, the sky 1.
    sunlight = float(toward[2])
    expected = (openness + np.where(shadow, 0.0, sunlight)) / (1 + sunlight)
    for part in (shadow, sunny):
        np.testing.assert_allclose(share[part], expected[part], atol=0.05)


def test_wide_lamps_are_soft_and_have_no_grain() -> None:
    toward = np.array([0.0, 0.6, 0.8])
    renderer = on("floor", sun(toward, 12.0))
    points, share = lit_floor(renderer)
    assert renderer._surface.floor.is_soft == 1
    other = renderer.render_image(CAMERA, samples_per_pixel=16, seed=9)[0]
    first, mask = renderer.render_image(CAMERA, samples_per_pixel=16, seed=0)
    assert np.abs(first.astype(int) - other)[mask == 0].max() <= 4
    behind = np.abs(points[:, 0]) + np.abs(points[:, 1] + 0.75 * RADIUS) < 0.3 * RADIUS
    away = np.linalg.norm(points[:, :2], axis=1) > 0.45
    assert share[behind].max() < 0.45 and share[away].min() > 0.93


def test_the_underside_is_dark_near_the_contact_and_lit_beside_it() -> None:
    renderer = under_grey_sky("table")
    renderer._measure_openness()
    heights = ball().vertices[:, 2] / RADIUS
    openness = renderer._surface.openness.numpy()[: len(heights), 0]
    assert openness[heights < -0.97].max() < 0.35
    middle = openness[(heights > -0.65) & (heights < -0.55)]
    assert 0.6 < middle.min() and middle.max() < 0.95
    assert openness[heights > 0.5].min() > 0.97


def test_a_table_carries_the_ball_and_is_not_an_object() -> None:
    renderer = under_grey_sky("table")
    mask = renderer.render_image(CAMERA, 4)[1]
    view = renderer.render_geometry(CAMERA)
    np.testing.assert_array_equal(mask, under_grey_sky("none").render_image(CAMERA, 4)[1])
    points = CAMERA.unproject(pixel_centers(161, 121), view.depth)
    top = (view.object_ids == 0) & (view.material_ids == 1)
    np.testing.assert_allclose(
        points[top][:, 2][view.normals_world[top][:, 2] == 1], -RADIUS, atol=1e-6
    )


def test_auto_puts_small_things_on_a_table_and_large_ones_on_the_floor() -> None:
    small, large = ball(0.2), ball(0.4)
    room = replace(GREY_SKY, is_room=True)
    assert set_up(small, GREY_SKY, "auto", 1.0)[0].has_furniture
    assert set_up(small, GREY_SKY, "auto", 1.0)[2] == "table"
    assert set_up(large, GREY_SKY, "auto", 1.0)[2] == "floor"
    assert not set_up(large, GREY_SKY, "auto", 1.0)[0].has_furniture
    assert not set_up(small, room, "auto", 1.0)[0].has_furniture
    table, surround, _ = set_up(small, room, "table", 1.0)
    assert surround.floor == pytest.approx(-0.2 - 0.75)
    assert planes_of(table, surround)[0] is not None
    wide = table_scene(0.0, -0.75, np.array([(-1.0, -0.1, 0.0), (1.0, 0.1, 0.2)]))
    assert wide.vertices[:, 0].max() == pytest.approx(1.25)
