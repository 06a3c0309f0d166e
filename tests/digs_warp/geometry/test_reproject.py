"""The projection of the package against the matrix K, and its twin for kernels against NumPy."""

# Warp's stubs do not type device code.
# pyright: reportIndexIssue=false

import numpy as np
import pytest
import warp as wp
from numpy.testing import assert_allclose, assert_array_equal

from digs_warp.geometry import reproject_kernel as twin
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.reproject import (
    FINE,
    DepthTolerance,
    Pinholes,
    compare_depth,
    is_inside,
    project,
    reproject,
    unproject,
    unproject_pixels,
)
from digs_warp.geometry.rigid import look_at

K = Intrinsics(641, 358, 510.3, 498.7, 301.2, 190.4)
POINTS = np.random.default_rng(0).normal(size=(200, 3))
CAMERA = Camera(K, look_at(np.array([0.5, -2, 0.3]), np.zeros(3), np.array([0, 0, 1.0])))


def test_a_reprojection_is_the_pixel_that_the_camera_shows_a_point_in() -> None:
    px, depth = CAMERA.project(POINTS)
    found = reproject(POINTS, CAMERA.cam_from_world, K)
    inside = CAMERA.shows(px, depth)
    assert 20 < inside.sum() < 190
    assert_array_equal(found.inside, inside)
    assert_array_equal(found.depth, depth)
    assert_array_equal(found.columns[inside], np.floor(px[inside, 0]))
    assert_array_equal(found.rows[inside], np.floor(px[inside, 1]))
    assert not found.rows[~inside].any() and not found.columns[~inside].any()
    centers = unproject_pixels(found.rows, found.columns, depth, K)
    expected = np.floor(px[inside]) + 0.5
    assert_allclose(np.stack(project(centers, K)[:2], axis=1)[inside], expected, rtol=1e-9)


def test_several_cameras_at_once_are_each_alone() -> None:
    other = K.resized(320, 200)
    poses = np.stack([CAMERA.cam_from_world, np.eye(4)])
    fields = [[getattr(k, name)] for name in Pinholes._fields for k in (K, other)]
    both = reproject(POINTS, poses, Pinholes(*np.array(fields).reshape(6, 2, 1)))
    for number, k in enumerate((K, other)):
        alone = reproject(POINTS, poses[number], k)
        assert_allclose(both.points[number], alone.points, rtol=1e-12)
        assert_array_equal(both.inside[number], alone.inside)
        assert_array_equal(both.rows[number], alone.rows)


def test_frames_agree_within_the_tolerance_and_else_one_hides_or_contradicts_the_other() -> None:
    depth = np.full(5, 2.0)
    measured = np.array([2.03, 1.5, 2.05, np.nan, 1.95])
    for tolerance in (FINE, DepthTolerance(0.0, 0.04), DepthTolerance(0.01, 0.02)):
        found = compare_depth(depth, measured, tolerance)
        assert found.agrees.tolist() == [True, False, False, False, False]
        assert found.occluded.tolist() == [False, True, False, False, True]
        assert found.seen_through.tolist() == [False, False, True, False, False]


@wp.kernel
def twin_kernel(
    points: wp.array[wp.vec3d], numbers: wp.array[wp.float64], found: wp.array2d[wp.float64]
):
    i = wp.tid()
    p = points[i]
    u, v = twin.project(p, numbers[0], numbers[1], numbers[2], numbers[3])
    x, y = twin.ray_through(u, v, numbers[0], numbers[1], numbers[2], numbers[3])
    found[i, 0] = u
    found[i, 1] = v
    found[i, 2] = x * p[2]
    found[i, 3] = y * p[2]
    found[i, 4] = wp.where(twin.is_inside(u, v, p[2], 641, 358), wp.float64(1.0), wp.float64(0.0))
    close = twin.agrees(p[2], wp.float64(1.0), numbers[4])
    found[i, 5] = wp.where(close, wp.float64(1.0), wp.float64(0.0))


@pytest.mark.parametrize("limit", [0.3, 0.0])
def test_kernels_project_as_numpy_does(limit: float) -> None:
    found = wp.zeros((len(POINTS), 6), dtype=wp.float64, device="cpu")
    numbers = wp.array([K.fx, K.fy, K.cx, K.cy, limit], dtype=wp.float64, device="cpu")
    points = wp.array(POINTS, dtype=wp.vec3d, device="cpu")
    wp.launch(twin_kernel, len(POINTS), [points, numbers, found], device="cpu")
    u, v, depth = project(POINTS, K)
    assert_allclose(found.numpy()[:, :2], np.stack([u, v], axis=1), rtol=1e-12)
    assert_allclose(found.numpy()[:, 2:4], unproject(u, v, depth, K)[:, :2], rtol=1e-9)
    assert_array_equal(found.numpy()[:, 4], is_inside(u, v, depth, K))
    agree = compare_depth(depth, np.ones_like(depth), DepthTolerance(0.0, limit)).agrees
    assert_array_equal(found.numpy()[:, 5], agree)
