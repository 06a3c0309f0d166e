"""Sphere, dome and room around the scene: depth, normals and colors against the float64 twin."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.images import linear_from_srgb
from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.session import prepare_session
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.render.views import CameraTrack
from digs_warp.sim.scene.environment import Environment, panorama_directions
from digs_warp.sim.scene.scene import Material
from reference.plates import plate
from reference.surround_twin import exits, normals, panorama_directions_of

UP = np.array([0.0, 0.0, 1.0])
INTRINSICS = Intrinsics.from_fov(161, 121, 75.0)
# Sees floor and walls.
CAMERA = Camera(INTRINSICS, look_at(np.array([0.9, -0.4, 0.5]), np.array([0.0, 0.1, 0.2]), UP))
# A speck behind the camera: nothing but the surround is in view.
GREY = Material("gray", np.full(3, 0.5, np.float32))
SPECK = plate((2.5, -1.3, 1.0), (1e-3, 0.0, 0.0), (0.0, 1e-3, 0.0), GREY)
DIRECTIONS = (panorama_directions(512, 256) + 1).astype(np.float32) / 2
SHAPES = {
    "sphere": Environment(DIRECTIONS, 4.0),
    "dome": Environment(DIRECTIONS, 6.0, floor=-0.3),
    "room": Environment(DIRECTIONS, 3.2, floor=-0.3, is_room=True),
}


def turned(angle: float) -> np.ndarray:
    """A rotation about the vertical axis of a camera, (4, 4)."""
    pose = np.eye(4)
    pose[:3, :3] = cv2.Rodrigues(np.array([0.0, angle, 0.0]))[0]
    return pose


def rays_of(camera: Camera) -> np.ndarray:
    """World rays of the pixel centers with z_cam = 1."""
    px = pixel_centers(camera.intrinsics.width, camera.intrinsics.height)
    return camera.unproject(px, np.ones(px.shape[:2])) - camera.center_world


@pytest.mark.parametrize("shape", SHAPES)
def test_depth_and_normals_are_those_of_the_boundary(shape: str) -> None:
    environment = SHAPES[shape]
    seen = RaycastRenderer(SPECK, environment).render_geometry(CAMERA)
    depth, found, materials = seen.depth, seen.normals_world, seen.material_ids
    rays = rays_of(CAMERA)
    expected = exits(environment.surround, CAMERA.center_world, rays)
    np.testing.assert_allclose(depth, expected, rtol=2e-6)
    assert (materials == -1).all()
    points = CAMERA.center_world + expected[..., None] * rays
    upright = normals(environment.surround, points)
    # Where two faces meet, either normal is right.
    wrong = np.abs(found - upright).max(axis=-1) > 1e-5
    assert wrong.mean() < 0.002
    if environment.floor is not None:
        on_floor = upright[..., 2] == 1
        assert 0.2 < on_floor.mean() < 0.9
        heights = CAMERA.center_world[2] + depth[on_floor] * rays[on_floor, 2]
        np.testing.assert_allclose(heights, environment.floor, atol=1e-6)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_boundary_shows_the_panorama(shape: str) -> None:
    environment = SHAPES[shape]
    renderer = RaycastRenderer(SPECK, environment)
    rays = rays_of(CAMERA)
    distances = exits(environment.surround, CAMERA.center_world, rays)
    points = CAMERA.center_world + distances[..., None] * rays
    expected = panorama_directions_of(environment.surround, points)
    image, _ = renderer.render_image(CAMERA, samples_per_pixel=1)
    shown = linear_from_srgb(image / 255.0)
    # A byte near white is 0.9 % of it.
    bright = np.clip((expected + 1) / 2 * renderer.exposure, 0, 1)
    np.testing.assert_allclose(shown, bright, atol=0.012)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("turn", [0.002, 0.2])
def test_a_moving_camera_takes_the_mean_over_its_exposure(shape: str, turn: float) -> None:
    """Short of a texel it may take the middle; beyond that, each of the moments."""
    renderer = RaycastRenderer(SPECK, replace(SHAPES[shape], level=0.5))  # nothing is clipped
    angles = np.linspace(-turn, turn, 4)
    cameras = [Camera(INTRINSICS, CAMERA.world_from_cam @ turned(angle)) for angle in angles]
    moving = CameraTrack(INTRINSICS, np.stack([each.world_from_cam for each in cameras])[None])
    taken = linear_from_srgb(renderer.photograph(moving, 1).image / 255.0)
    still = [renderer.render_image(each, samples_per_pixel=1)[0] for each in cameras]
    expected = linear_from_srgb(np.stack(still) / 255.0).mean(axis=0)
    np.testing.assert_allclose(taken, expected, atol=0.012)


@pytest.mark.parametrize("shape", ["dome", "room"])
def test_detail_far_away_is_filtered_and_near_is_not(shape: str) -> None:
    """Stripes of a panorama finer than a pixel of the floor far away average out."""
    noise = np.random.default_rng(3).uniform(0, 1, (1024, 2048, 1)).astype(np.float32)
    environment = replace(SHAPES[shape], radiance=np.repeat(noise, 3, axis=2))
    coarse = Camera(Intrinsics.from_fov(41, 31, 75.0), CAMERA.world_from_cam)
    image, _ = RaycastRenderer(SPECK, environment).render_image(coarse, samples_per_pixel=1)
    fine = Camera(Intrinsics.from_fov(41, 31, 2.0), CAMERA.world_from_cam)
    sharp, _ = RaycastRenderer(SPECK, environment).render_image(fine, samples_per_pixel=1)
    assert image[..., 0].std() < 12 < sharp[..., 0].std()


@pytest.mark.parametrize(
    ("shape", "eye", "words"),
    [
        ("dome", (0.5, 0.0, -0.31), "on or below the floor"),
        ("dome", (7.5, 0.0, 0.5), "outside the surround"),
        ("room", (0.0, 3.3, 0.5), "outside the surround"),
        ("room", (0.0, 0.0, 4.3), "outside the surround"),
    ],
)
def test_a_camera_outside_is_refused(
    shape: str, eye: tuple[float, float, float], words: str
) -> None:
    renderer = RaycastRenderer(SPECK, SHAPES[shape])
    camera = Camera(INTRINSICS, look_at(np.array(eye), np.zeros(3), np.array([0.0, 0.6, 0.8])))
    with pytest.raises(DigsError, match=words):
        renderer.render_geometry(camera)


def test_the_floor_is_under_the_object_and_the_walk_inside() -> None:
    config = SimulateConfig(profile="bare-matcher", frames=9, width=64)
    session = prepare_session(config, load_inputs(config))
    lowest = float(session.scene.vertices[:, 2].min())
    surround = session.environment.surround
    assert surround.floor == lowest and surround.is_room
    for moment in session.moments:
        assert surround.holds(session.walk.pose(moment)[:3, 3])
