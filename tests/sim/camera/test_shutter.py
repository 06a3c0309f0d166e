"""The shutter: rows at their times, exposures over theirs, against the geometry of a turning camera."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from digs_warp.data.images import linear_from_srgb
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at, rigid
from digs_warp.sim.camera.shutter import BandedRays, Shutter, ShutteredEye
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.render.views import CameraTrack
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.color.encoding import decode, encode
from reference.plates import plate

K = Intrinsics.from_fov(160, 120, 50.0)
UP = np.array([0.0, 0.0, 1.0])
POSE = look_at(np.array([0.0, -2.0, 0.0]), np.zeros(3), UP)
SEED = np.random.SeedSequence(3)
TURN = 1.5  # [rad/s] about the camera's down axis
READOUT, EXPOSURE = 0.04, 0.03  # [s]


@pytest.fixture(scope="module")
def renderer() -> RaycastRenderer:
    """A tall gray plate, narrower than the view, in a gray room."""
    gray = Material("gray", np.full(3, 0.2, np.float32))
    scene = plate((0, 0, 0), (0.3, 0, 0), (0, 0, 3.0), gray)
    return RaycastRenderer(scene, Environment(np.ones((16, 32, 3), np.float32), 20.0))


def turning(rate: float, after: float) -> np.ndarray:
    """The camera turns to its right."""
    return POSE @ rigid(Rotation.from_rotvec([0, rate * after, 0]).as_matrix(), np.zeros(3))


def sliding(after: float) -> np.ndarray:
    """The camera moves to its right by 18 cm in an exposure."""
    return POSE @ rigid(np.eye(3), np.array([6.0 * after, 0, 0]))


def eye(renderer: RaycastRenderer, shutter: Shutter, rate: float = TURN) -> ShutteredEye:
    pose: Callable[[float], np.ndarray] = partial(turning, rate)
    return ShutteredEye(renderer, shutter, K, pose)


def exposure_by_views(
    renderer: RaycastRenderer, track: CameraTrack, samples: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Image and mask as the means, in linear light, of a whole view for each band and moment."""
    seeds = iter(np.random.SeedSequence(seed).generate_state(track.world_from_cam[..., 0, 0].size))
    bands = []
    for cameras in track.bands():
        views = [renderer.render_image(each, samples, int(next(seeds))) for each in cameras]
        light = np.stack([decode(image) for image, _ in views]).mean(axis=0, dtype=np.float32)
        cover = np.mean([mask for _, mask in views], axis=0)
        bands.append((encode(light), (cover + 0.5).astype(np.uint8)))
    images, masks = zip(*bands, strict=True)
    return np.concatenate(images), np.concatenate(masks)


def test_bands_and_views_share_out_their_times() -> None:
    shutter = Shutter(bands=4, views=2, readout_time=0.04, exposure_time=0.01)
    np.testing.assert_allclose(shutter.moments(0), [-0.0175, -0.0125])
    np.testing.assert_allclose(shutter.moments(3), [0.0125, 0.0175])
    assert np.concatenate([shutter.moments(band) for band in range(4)]).mean() == pytest.approx(0)
    np.testing.assert_array_equal(Shutter().moments(0), [0.0])


def test_an_ideal_shutter_changes_no_byte(renderer: RaycastRenderer) -> None:
    ideal = eye(renderer, Shutter())
    seed = int(SEED.generate_state(1)[0])
    image, mask = renderer.render_image(Camera(K, POSE), 2, seed)
    taken = ideal.photograph(2, SEED)
    np.testing.assert_array_equal(taken.image, image)
    np.testing.assert_array_equal(taken.mask, mask)
    for a, b in zip(ideal.geometry(), renderer.render_geometry(Camera(K, POSE)), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_rolling_shutter_leans_what_stands_upright(renderer: RaycastRenderer) -> None:
    depth, _, materials, _ = eye(renderer, Shutter(60, 1, READOUT)).geometry()
    assert depth.shape == (K.height, K.width)
    first = np.argmax(materials == 0, axis=1).astype(float)
    moments = (np.arange(K.height) + 0.5) / K.height * READOUT - READOUT / 2
    # The plate's left edge lies at an angle of atan(0.3 / 2) to the left; the camera turns right.
    angle = -np.arctan(0.3 / 2.0) - TURN * moments
    np.testing.assert_allclose(first, K.cx + K.fx * np.tan(angle), atol=1.0)
    assert first[0] - first[-1] == pytest.approx(TURN * READOUT * K.fx, rel=0.15)


def test_an_exposure_blurs_edges_by_the_motion_and_keeps_the_light(
    renderer: RaycastRenderer,
) -> None:
    sharp = eye(renderer, Shutter(), rate=0.0).photograph(16, SEED)[:2]
    blurred = eye(renderer, Shutter(1, 16, 0.0, EXPOSURE)).photograph(16, SEED)[:2]
    ramp = blurred[1][:, : K.width // 2].mean(axis=0) / 255
    partly = (ramp > 0.02) & (ramp < 0.98)
    # An edge 8.5 degrees off the axis moves by f (1 + tan^2) per radian.
    width = TURN * EXPOSURE * K.fx * (1 + 0.15**2)
    assert partly.sum() == pytest.approx(width, abs=1.5)
    steps = np.diff(ramp[partly])
    # All pixels have one of four patterns: their sixteen steps remain in the ramp.
    assert steps.mean() == pytest.approx(1 / width, rel=0.1) and steps.std() < 0.3 / width
    assert blurred[1].mean() == pytest.approx(sharp[1].mean(), rel=0.01)
    light = [linear_from_srgb(image / 255.0).mean() for image, _ in (sharp, blurred)]
    assert light[1] == pytest.approx(light[0], rel=0.01)


@pytest.mark.parametrize(
    ("see_through", "pose"),
    [(False, partial(turning, TURN)), (True, partial(turning, TURN)), (False, sliding)],
)
def test_a_moving_camera_sees_the_mean_of_many_views(
    see_through: bool, pose: Callable[[float], np.ndarray]
) -> None:
    """Rays that start along the way against whole views from there: pattern, edges, glass and surround."""
    rng = np.random.default_rng(0)
    pattern = rng.integers(40, 220, (24, 24, 3)).astype(np.uint8)
    opacity = 0.5 if see_through else 1.0
    surface = Material("pattern", np.ones(3), pattern, opacity=opacity)
    scene = plate((0, 0, 0), (0.4, 0, 0), (0, 0, 0.1), surface)
    sky = Environment(rng.uniform(0.3, 1.5, (16, 32, 3)).astype(np.float32), 6.0)
    renderer = RaycastRenderer(scene, sky)
    track = ShutteredEye(renderer, Shutter(3, 8, READOUT, EXPOSURE), K, pose).track
    image, mask = renderer.photograph(track, 4, seed=1)[:2]
    expected = [exposure_by_views(renderer, track, 4, seed) for seed in (2, 3)]
    # As close to the reference as that is to itself with other samples.
    for found, (first, second) in zip((image, mask), zip(*expected, strict=True), strict=True):
        noise = np.abs(first.astype(float) - second).mean()
        assert np.abs(found.astype(float) - first).mean() < 1.1 * noise + 0.5
        assert found.mean() == pytest.approx(first.mean(), abs=0.2)


def test_rays_of_the_bands_are_those_of_their_rows(renderer: RaycastRenderer) -> None:
    still, banded = eye(renderer, Shutter(), 0.0), eye(renderer, Shutter(7), 0.0)
    rays = banded.rays(0.1)
    assert isinstance(rays, BandedRays)
    where = np.random.default_rng(0).random((K.height, K.width)) < 0.3
    depth = still.geometry().depth
    for some in (np.ones_like(where), where):
        expected = still.rays(0.1).right_visibility(some, depth)
        assert (rays.right_visibility(some, depth) != expected).mean() < 0.002
        np.testing.assert_allclose(
            rays.depth_behind(some), still.rays(0.1).depth_behind(some), rtol=1e-4
        )
