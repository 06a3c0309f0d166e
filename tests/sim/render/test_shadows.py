"""Shadows of bright spots: penumbrae against a float64 twin, the same in both eyes, exact store."""

import numpy as np
import pytest

from digs_warp.data.images import linear_from_srgb
from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.render import shadows
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.environment import Environment, panorama_directions, solid_angles
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Material, Scene
from reference.plates import plate, scene_of

INTRINSICS = Intrinsics.from_fov(160, 90, 40.0)
UP = np.array([0.0, 0.0, 1.0])
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
