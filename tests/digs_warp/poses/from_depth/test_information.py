"""What holds a motion between two frames."""

from dataclasses import replace

import numpy as np

from digs_warp.geometry.rigid import invert_rigid, rigid, transform_points
from digs_warp.poses.from_depth.pair_motion import information
from digs_warp.poses.views import view_of
from reference.textured_plane import picture, ring_of_poses

TRUTH = ring_of_poses(16)
FIRST, SECOND = (view_of(picture(pose)) for pose in TRUTH[:2])
TRUE = invert_rigid(TRUTH[1]) @ TRUTH[0]


def one_by_one(points: np.ndarray) -> np.ndarray:
    """Sum over points in the axes of the second frame; slopes by differences."""
    total = np.eye(6)
    for q in points:
        slopes = np.zeros((3, 6))
        for axis in range(3):
            slopes[:, axis] = np.cross(np.eye(3)[axis], q)
            slopes[axis, 3 + axis] = 1.0
        total += slopes.T @ slopes
    return total


def held(chosen: np.ndarray) -> np.ndarray:
    """Of some points of the first frame, those that the second sees."""
    k = SECOND.picture.intrinsics
    x, y, z = transform_points(TRUE, FIRST.points[chosen].astype(np.float64)).T
    u, v = x / z * k.fx + k.cx, y / z * k.fy + k.cy
    return (u >= 0) & (u < k.width) & (v >= 0) & (v < k.height)


def test_it_is_the_sum_over_the_points_on_the_same_surface() -> None:
    inside = held(np.ones(len(FIRST.points), bool))
    assert 0.5 * len(inside) < np.count_nonzero(inside) < len(inside)
    expected = one_by_one(transform_points(TRUE, FIRST.points[inside].astype(np.float64)))
    np.testing.assert_allclose(information(FIRST, SECOND, TRUE), expected, rtol=1e-9, atol=1e-6)


def test_other_surfaces_and_what_is_far_away_hold_nothing() -> None:
    farther = view_of(replace(SECOND.picture, depth=1.3 * SECOND.picture.depth))
    np.testing.assert_array_equal(information(FIRST, farther, TRUE), np.eye(6))
    # All ten times as large, beside what is usual in the first picture.
    far = replace(FIRST, points=10 * FIRST.points)
    deep = replace(SECOND, picture=replace(SECOND.picture, depth=10 * SECOND.picture.depth))
    moved = rigid(TRUE[:3, :3], 10 * TRUE[:3, 3])
    np.testing.assert_array_equal(information(far, deep, moved), np.eye(6))
