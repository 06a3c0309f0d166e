"""Image motion against projection, and slopes along surfaces."""

import numpy as np
import pytest
from reference.stereo_frames import make_rig

from digs_warp.camera import Camera, pixel_centers
from digs_warp.geometry import rigid
from sim.sensor.motion import image_motion
from sim.sensor.slopes import surface_slope, width_ratio


def test_image_motion_is_that_of_projected_points() -> None:
    intrinsics = make_rig(64, 48).intrinsics
    depth = np.random.default_rng(0).uniform(0.5, 4, (48, 64)).astype(np.float32)
    velocity, turn, dt = np.array([0.3, -0.2, 0.5]), np.array([0.4, -0.7, 0.9]), 1e-5
    u, v = image_motion(depth, intrinsics, tuple(velocity), tuple(turn))

    before = Camera(intrinsics, np.eye(4))
    x, y, z = turn * dt
    rotation = np.eye(3) + np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    left, _, right = np.linalg.svd(rotation)  # the nearest rotation
    after = Camera(intrinsics, rigid(left @ right, velocity * dt))
    px = pixel_centers(64, 48)
    moved, _ = after.project(before.unproject(px, depth.astype(np.float64)))
    expected = (moved - px) / dt
    np.testing.assert_allclose(np.stack([u, v], -1), expected, rtol=1e-3, atol=0.1)


def test_what_has_no_depth_moves_as_if_far_away() -> None:
    intrinsics = make_rig(8, 6).intrinsics
    depth = np.full((6, 8), np.nan, np.float32)
    u, v = image_motion(depth, intrinsics, (5.0, 5.0, 5.0), (0.0, 0.0, 0.0))
    assert (u == 0).all() and (v == 0).all()


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("slope", [0.3, -0.7])
def test_slope_of_a_plane_is_exact_and_ignores_steps(axis: int, slope: float) -> None:
    ramp = slope * np.arange(40, dtype=np.float32)
    ramp[20:] += 30
    disparity = np.broadcast_to(ramp if axis == 1 else ramp[:, None], (40, 40))
    np.testing.assert_allclose(surface_slope(disparity, axis), slope, atol=1e-5)


def test_slope_is_zero_where_it_cannot_be_told() -> None:
    assert (surface_slope(np.full((5, 5), np.nan, np.float32), 1) == 0).all()
    assert (surface_slope(np.ones((5, 1), np.float32), 1) == 0).all()


def test_width_ratio_is_infinite_where_the_right_eye_sees_the_back() -> None:
    slopes = np.array([0.0, 1 - np.exp(-0.5), 1 - np.exp(0.5), 1.0, 3.0], np.float32)
    np.testing.assert_allclose(width_ratio(slopes), [0, 0.5, 0.5, np.inf, np.inf], rtol=1e-5)
