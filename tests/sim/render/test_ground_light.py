"""Shadows: of a ball on floors and tables, openness of scans, penumbrae of lamps, against closed forms."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh

from digs_warp.data.images import linear_from_srgb
from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.render import ambient_occlusion, shadows
from digs_warp.sim.render.ground_light import measure_plane, planes_of
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.environment import Environment, panorama_directions, set_up, solid_angles
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Material, Scene
from digs_warp.sim.scene.table import table_scene
from reference.plates import plate, scene_of

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


SKY = Environment(np.ones((16, 32, 3), np.float32))


def measured(scene: Scene) -> np.ndarray:
    renderer = RaycastRenderer(scene, SKY)
    ambient_occlusion.measure_openness(scene, renderer._surface)
    return renderer._surface.openness.numpy()[:, 0]


def test_the_nodes_of_cells_are_as_open_as_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two balls that touch a board of two large faces, and a shell 1.5 cm outside of one of them."""
    parts = [trimesh.creation.icosphere(4, 0.1) for _ in range(2)]
    parts[1].apply_translation((0.2, 0, 0))
    shell = trimesh.creation.icosphere(4, 0.115)
    shell.update_faces(shell.triangles_center[:, 2] > 0.03)
    board = trimesh.creation.box((0.8, 0.6, 0.02))
    board.apply_translation((0.1, 0, -0.11))
    gray = Material("gray", np.full(3, 0.5))
    scene = join_scenes(
        *(scene_of(p.vertices, p.faces, p.vertex_normals, gray) for p in (*parts, shell, board))
    )
    for budget in ("RAY_BUDGET", "CELLS_BUDGET"):
        monkeypatch.setattr(ambient_occlusion, budget, 10**9)
    exact = measured(scene)
    monkeypatch.setattr(ambient_occlusion, "MOST_NODES", 1_000)
    monkeypatch.setattr(ambient_occlusion, "CELLS", 6_000)
    nodes = ambient_occlusion.openness_nodes(scene)
    chosen, _ = ambient_occlusion._cells(scene, nodes)
    assert len(chosen) < 0.6 * len(exact)
    sampled = measured(scene)
    errors = np.abs(sampled - exact)
    assert exact.std() > 0.2
    assert errors.mean() < 0.015 and np.percentile(errors, 95) < 0.08
    # Nodes of large faces are measured themselves.
    of_board = np.unique([scene.faces[-12:], nodes.edges[-12:]])
    assert np.isin(of_board, chosen).all() and errors[of_board].max() < 1e-6
    # The ball under the shell is dark, the shell is not.
    top = scene.vertices[:, 2] > 0.07
    radius = np.linalg.norm(scene.vertices, axis=1)
    under, over = (top & (np.abs(radius - r) < 1e-4) for r in (0.1, 0.115))
    assert sampled[: len(top)][under].max() < 0.2 < 0.7 < sampled[: len(top)][over].min()


INTRINSICS = Intrinsics.from_fov(160, 90, 40.0)
EYE = Camera(INTRINSICS, look_at(np.array([-0.7, -0.2, 0.8]), np.zeros(3), UP))
HEIGHT = 64
ROWS, COLUMNS = slice(14, 20), slice(60, 68)
SHADE_HEIGHT, SHADE_EDGE = 0.12, 0.02
MATTE = Material("matte", np.full(3, 0.5, np.float32))


def lamp() -> Environment:
    """A dim, even sky with one rectangular lamp."""
    radiance = np.full((HEIGHT, 2 * HEIGHT, 3), 0.02, np.float32)
    radiance[ROWS, COLUMNS] = 60.0
    return Environment(radiance)


def shaded_floor() -> Scene:
    """A floor, and above a part of it a plate that ends at a straight edge along y."""
    floor = plate((0, 0, 0), (0.5, 0, 0), (0, 0.5, 0), MATTE)
    shade = plate((SHADE_EDGE + 0.5, 0, SHADE_HEIGHT), (0.5, 0, 0), (0, 2.0, 0), MATTE)
    return join_scenes(floor, shade)


def fine_plate(coarse: Scene, cells: int) -> Scene:
    """A plate divided into cells x cells parallelograms."""
    along = np.linspace(0, 1, cells + 1)
    v, u = (part[..., None] for part in np.meshgrid(along, along, indexing="ij"))
    corners = coarse.vertices
    vertices = corners[0] + u * (corners[1] - corners[0]) + v * (corners[3] - corners[0])
    number = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    normals = np.tile(coarse.normals[0], (number.size, 1))
    return scene_of(vertices.reshape(-1, 3), faces, normals, MATTE)


def true_share(points: np.ndarray, parts: int = 8) -> np.ndarray:
    """Light of the lamp that the edge of the plate lets through to points of the floor, over all of it."""
    fine = panorama_directions(2 * HEIGHT * parts, HEIGHT * parts)
    area = solid_angles(2 * HEIGHT * parts, HEIGHT * parts)
    rows, columns = (slice(s.start * parts, s.stop * parts) for s in (ROWS, COLUMNS))
    toward = fine[rows, columns].reshape(-1, 3)
    weight = np.broadcast_to(area[rows], fine[rows, columns].shape[:2]).reshape(-1)
    crossing = points[:, None, 0] + SHADE_HEIGHT * toward[:, 0] / toward[:, 2]
    return ((crossing < SHADE_EDGE) * weight).sum(axis=1) / weight.sum()


def floor_in_view(renderer: RaycastRenderer, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Return points of the pixels, and where they are on the floor, away from its edges."""
    depth = renderer.render_geometry(camera)[0]
    points = camera.unproject(pixel_centers(INTRINSICS.width, INTRINSICS.height), depth)
    on_floor = (np.abs(points[..., 2]) < 1e-3) & (np.abs(points[..., :2]) < 0.45).all(axis=-1)
    inner = on_floor.copy()
    for axis in (0, 1):
        for shift in (-2, -1, 1, 2):
            inner &= np.roll(on_floor, shift, axis)
    return points, inner


def linear(renderer: RaycastRenderer, camera: Camera, seed: int = 0) -> np.ndarray:
    return linear_from_srgb(renderer.render_image(camera, 16, seed)[0][..., 0] / 255)


@pytest.fixture(scope="module")
def renderer() -> RaycastRenderer:
    return RaycastRenderer(shaded_floor(), lamp())


def test_a_penumbra_is_as_wide_and_as_bright_as_the_lamp_makes_it(
    renderer: RaycastRenderer,
) -> None:
    points, inner = floor_in_view(renderer, EYE)
    image = linear(renderer, EYE)[inner]
    share = true_share(points[inner])
    full, none = share == 1, share == 0
    half = (share > 0.05) & (share < 0.95)
    assert full.sum() > 300 and none.sum() > 300 and half.sum() > 300
    dark, bright = image[none].mean(), image[full].mean()
    assert bright > 10 * dark
    found = (image - dark) / (bright - dark)
    error = found - share
    assert abs(error[half].mean()) < 0.01
    assert np.sqrt((error[half] ** 2).mean()) < 0.025
    # The same lamp, 1.3 times as wide, would not pass.
    wider = 0.5 + (share - 0.5) / 1.3
    assert np.sqrt(((found - wider)[half] ** 2).mean()) > 0.05


def test_small_triangles_keep_the_share_that_their_vertices_see() -> None:
    """On a floor whose triangles are as small as pixels, and on a wall that stands on it."""
    floor = plate((0, 0, 0), (0.5, 0, 0), (0, 0.5, 0), MATTE)
    wall = plate((-0.3, 0, 0.2), (0, 0.4, 0), (0, 0, 0.2), MATTE)
    shade = plate((SHADE_EDGE + 0.5, 0, SHADE_HEIGHT), (0.5, 0, 0), (0, 2.0, 0), MATTE)
    scene = join_scenes(fine_plate(floor, 125), fine_plate(wall, 100), shade)
    renderer = RaycastRenderer(scene, lamp())
    from_lamp = Camera(INTRINSICS, look_at(np.array([0.5, -0.2, 1.3]), np.zeros(3), UP))
    for camera in (from_lamp, EYE):  # below the shade
        renderer.render_image(camera, 4)
    kept = renderer._surface.vertex_shadows.numpy()[1::2].astype(int)  # on the side of the normals
    seen, share = (kept > 0).all(axis=1), (kept - 1) / 254
    on_floor = np.arange(len(kept)) < 126**2
    x, z = scene.vertices[:, 0], scene.vertices[:, 2]
    tried = seen & on_floor & (x > -0.29)
    expected = true_share(scene.vertices[tried].astype(np.float64))
    keys = renderer._light.keys
    weights = keys.strengths.numpy()
    error = share[tried] @ (weights / weights.sum()) - expected
    half = (expected > 0.05) & (expected < 0.95)
    assert half.sum() > 300 and (expected == 1).sum() > 300 and (expected == 0).sum() > 300
    assert abs(error[half].mean()) < 0.01
    assert np.sqrt((error[half] ** 2).mean()) < 0.025
    foot = seen & ~on_floor & (z == 0) & (x < -0.2)
    assert foot.sum() > 30 and (share[foot] == 1).all()


def test_both_eyes_see_the_same_penumbra(renderer: RaycastRenderer) -> None:
    """One pixel of the right eye between two samples, moved by the disparity of the floor."""
    baseline = 0.05
    right_eye = EYE.shifted_right(baseline)
    points, inner = floor_in_view(renderer, EYE)
    share = np.zeros(inner.shape)
    share[inner] = true_share(points[inner])
    left, right = linear(renderer, EYE, 1), linear(renderer, right_eye, 2)
    depth = renderer.render_geometry(EYE)[0]
    rows, columns = np.nonzero((share > 0.05) & (share < 0.95))
    place = columns - INTRINSICS.fx * baseline / depth[rows, columns]
    seen = place > 1
    rows, columns, place = rows[seen], columns[seen], place[seen]
    start = np.floor(place).astype(int)
    warped = (1 - place + start) * right[rows, start] + (place - start) * right[rows, start + 1]
    difference = (left[rows, columns] - warped) / left[inner].max()
    assert len(rows) > 300
    assert np.sqrt((difference**2).mean()) < 0.015


def test_what_was_drawn_before_and_the_size_of_the_store_change_nothing(
    monkeypatch: pytest.MonkeyPatch, renderer: RaycastRenderer
) -> None:
    """Also a store that is far too small, so that every share is replaced many times."""
    after = renderer.render_image(EYE, 2)[0]
    monkeypatch.setattr(shadows, "STORE_WORDS", 1 << 14)
    fresh = RaycastRenderer(shaded_floor(), lamp())
    np.testing.assert_array_equal(fresh.render_image(EYE, 2)[0], after)
