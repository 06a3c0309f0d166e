"""Shading against closed forms: spots, shadows, and extreme light."""

import numpy as np
import pytest

from digs_warp.geometry.camera import Camera, pixel_centers
from digs_warp.geometry.rigid import look_at
from digs_warp.geometry.sh import sh_basis
from digs_warp.sim.render.environment_light import irradiance_coefficients
from digs_warp.sim.render.lighting import take_out_spots
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.environment import Environment, panorama_directions, solid_angles
from digs_warp.sim.scene.join import join_scenes
from reference.plates import scene_of
from reference.shading_scenes import (
    ABOVE,
    BLACK,
    INTRINSICS,
    MATTE,
    UP,
    WHITE,
    floor,
    linear_image,
    sunny,
)

# ---- spots and shadows ----


def test_the_sun_casts_a_shadow_where_geometry_says() -> None:
    environment, sun = sunny()
    assert sun[2] > 0.4
    scene = join_scenes(floor(MATTE), floor(MATTE, z=0.15, half=0.09))
    renderer = RaycastRenderer(scene, environment)
    image, mask = renderer.render_image(ABOVE)
    depth = renderer.render_geometry(ABOVE)[0]
    points = ABOVE.unproject(pixel_centers(160, 90), depth)
    on_floor = (np.abs(points[..., 2]) < 1e-3) & (mask == 255)
    # Where the way to the sun passes the height of the small plate.
    crossing = np.abs((points + (0.15 - points[..., 2:]) * sun / sun[2])[..., :2]).max(axis=-1)
    # A margin for half the texel's own width, which lies aslant (the penumbra), and for a pixel.
    edge = 0.15 * (np.pi / 64) / sun[2] ** 2 + 0.01
    shadow, lit = on_floor & (crossing < 0.09 - edge), on_floor & (crossing > 0.09 + edge)
    assert shadow.sum() > 20 and lit.sum() > 1000
    assert image[shadow].max() < 30 and image[lit].min() > 150


def test_a_round_body_of_few_faces_has_no_steps_at_its_terminator() -> None:
    """Brightness falls smoothly toward the dark side although shadow rays start on flat faces."""
    segments = 8
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    vertices = np.concatenate([0.3 * ring - 0.4 * UP, 0.3 * ring + 0.4 * UP])
    a = np.arange(segments)
    b = a + segments + 1
    faces = np.concatenate([np.stack([a, a + 1, b + 1], 1), np.stack([a, b + 1, b], 1)])
    cylinder = scene_of(vertices, faces, np.concatenate([ring, ring]), MATTE)
    environment, sun = sunny(sky=5.0)
    side = 1.2 * np.cross(UP, sun) / np.linalg.norm(np.cross(UP, sun))  # sees light and dark half
    camera = Camera(INTRINSICS, look_at(side, np.zeros(3), UP))
    renderer = RaycastRenderer(cylinder, environment)
    row = linear_image(renderer, camera, 64)[45, :, 0]
    shown = row[renderer.render_image(camera, 4)[1][45] == 255]
    assert np.ptp(shown) > 0.3
    assert np.abs(np.diff(shown)).max() < 0.1 * np.ptp(shown)


def test_spots_and_rest_together_keep_the_light() -> None:
    environment, sun = sunny(sun=2000.0, sky=1.0)
    radiance = environment.radiance.astype(np.float64)
    smooth, keys = take_out_spots(radiance)
    assert keys.count == 1
    vector, color = keys.vectors.numpy()[0], keys.colors.numpy()[0]
    np.testing.assert_allclose(vector, sun, atol=1e-3)
    directions, areas = panorama_directions(64, 32), solid_angles(64, 32)
    for normal in (sun, UP, np.array([0.6, 0, -0.8])):
        cosine = np.maximum(directions @ normal, 0)[..., None]
        expected = (radiance * cosine * areas[..., None]).sum(axis=(0, 1)) / np.pi
        found = max(float(normal @ vector), 0.0) * color
        found = found + (sh_basis(normal, 2) @ irradiance_coefficients(smooth))
        np.testing.assert_allclose(found, expected, rtol=0.03)


def test_two_lamps_are_two_spots_and_their_points_lie_on_them() -> None:
    radiance = np.full((64, 128, 3), 0.1)
    radiance[20:24, 30:34] = 60.0
    radiance[30:36, 90:96] = 30.0
    _, keys = take_out_spots(radiance)
    assert keys.count == 2
    points = keys.points.numpy()
    for spot, (rows, columns) in enumerate([((20, 24), (30, 34)), ((30, 36), (90, 96))]):
        directions = panorama_directions(128, 64)[slice(*rows), slice(*columns)].reshape(-1, 3)
        distance = np.linalg.norm(points[spot][:, None] - directions, axis=-1).min(axis=1)
        assert distance.max() < np.sqrt(0.5) * np.pi / 64 + 1e-6
        # Every texel of an even lamp is aimed at about equally often.
        nearest = np.linalg.norm(points[spot][:, None] - directions, axis=-1).argmin(axis=1)
        assert len(np.unique(nearest)) >= min(len(directions), 16)


@pytest.mark.parametrize("environment", [WHITE, BLACK])
def test_even_surrounds_have_no_spots(environment: Environment) -> None:
    smooth, keys = take_out_spots(environment.radiance.astype(np.float64))
    assert keys.count == 0
    np.testing.assert_array_equal(smooth, environment.radiance)


# ---- extreme light ----
