"""Image motion against projection, and slopes along surfaces."""

import numpy as np
import pytest

from digs_warp.camera import Camera, pixel_centers
from digs_warp.geometry import rigid
from digs_warp.sim.sensor.motion import image_motion
from digs_warp.sim.sensor.slopes import (
    slope_along_columns,
    steep_pixels,
    surface_slope,
    width_ratio,
)
from reference.slopes_twin import slopes_twin
from reference.stereo_frames import make_rig


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


@pytest.mark.parametrize("slope", [0.3, -0.7])
def test_slope_of_a_plane_is_exact_and_ignores_steps(slope: float) -> None:
    ramp = slope * np.arange(40, dtype=np.float32)
    ramp[20:] += 30
    along_rows = np.broadcast_to(ramp, (40, 40))
    np.testing.assert_allclose(surface_slope(along_rows), slope, atol=1e-5)
    rows, columns = np.indices((40, 40)).reshape(2, -1)
    down = slope_along_columns(np.ascontiguousarray(along_rows.T), rows, columns)
    np.testing.assert_allclose(down, slope, atol=1e-5)


def test_slope_is_zero_where_it_cannot_be_told() -> None:
    assert (surface_slope(np.full((5, 5), np.nan, np.float32)) == 0).all()
    assert (surface_slope(np.ones((5, 1), np.float32)) == 0).all()
    assert (
        slope_along_columns(np.ones((1, 5), np.float32), np.zeros(5, int), np.arange(5)) == 0
    ).all()


def rough(shape: tuple[int, int]) -> np.ndarray:
    """Disparity with slopes of every size and pixels without a value, also at the rim."""
    rng = np.random.default_rng(shape[1])
    disparity = np.cumsum(rng.choice([0.0, 0.1, -0.3, 5.0, -4.0], shape), axis=1).astype(np.float32)
    disparity[rng.random(shape) < 0.1] = np.nan
    return disparity


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 2), (3, 70), (20, 150)])
def test_slopes_steep_pixels_and_steps_are_those_of_the_formulas(shape: tuple[int, int]) -> None:
    disparity = rough(shape)
    slopes = [slopes_twin(disparity, axis) for axis in (0, 1)]
    np.testing.assert_array_equal(surface_slope(disparity), slopes[1])
    rows, columns = np.indices(shape).reshape(2, -1)
    np.testing.assert_array_equal(slope_along_columns(disparity, rows, columns), slopes[0].ravel())
    steep = np.maximum(*np.abs(slopes)) > 0.2
    np.testing.assert_array_equal(
        steep_pixels(disparity, surface_slope(disparity), 0.2), np.flatnonzero(steep)
    )


def test_width_ratio_is_infinite_where_the_right_eye_sees_the_back() -> None:
    slopes = np.array([0.0, 1 - np.exp(-0.5), 1 - np.exp(0.5), 1.0, 3.0], np.float32)
    np.testing.assert_allclose(width_ratio(slopes), [0, 0.5, 0.5, np.inf, np.inf], rtol=1e-5)
