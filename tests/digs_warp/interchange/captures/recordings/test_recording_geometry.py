"""Lenses, cameras in other places, and poses of few digits."""

import numpy as np
import pytest

from digs_warp.camera import Camera, Intrinsics, pixel_centers
from digs_warp.checks import CaptureError
from digs_warp.geometry import look_at
from digs_warp.interchange.captures.resample import resample_depth, undistort
from digs_warp.interchange.captures.to_capture import nearly_rigid


def test_distortion_is_taken_out() -> None:
    k = Intrinsics(200, 150, 160.0, 165.0, 97.0, 78.0)
    lens = (-0.2, 0.05, 0.002, -0.001)
    # A picture whose value at a pixel says where it lies, to a quarter of a pixel, seen through the lens.
    centers = pixel_centers(200, 150)
    ramp = np.clip(4 * centers[..., 0], 0, 255).astype(np.uint8)
    image = np.repeat(ramp[..., None], 3, axis=2)
    found, depth, mask = undistort(image, np.ones((150, 200), np.float32), ramp, k, lens)
    x, y = (centers[..., 0] - k.cx) / k.fx, (centers[..., 1] - k.cy) / k.fy
    r2 = x**2 + y**2
    k1, k2, p1, p2 = lens
    distorted = x * (1 + k1 * r2 + k2 * r2**2) + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    expected = distorted * k.fx + k.cx
    side = np.s_[15:-15, 8:45]  # where half a pixel in the lens's center would show
    difference = found[side][..., 0] / 4 - expected[side]
    assert np.abs(difference).max() < 0.4 and abs(difference.mean()) < 0.02
    assert depth is not None and mask is not None
    np.testing.assert_array_equal(mask, found[..., 0])


def test_depth_of_another_camera_is_sought_along_the_same_ray() -> None:
    rng = np.random.default_rng(3)
    source = Intrinsics(40, 30, 50.0, 50.0, 20.0, 15.0)
    target = Intrinsics(64, 48, 64.0, 66.0, 30.0, 25.0)
    depth = rng.uniform(1, 2, (30, 40)).astype(np.float32)
    found = resample_depth(depth, source, target)
    camera = Camera(source, np.eye(4))
    centers = pixel_centers(64, 48)
    rays = Camera(target, np.eye(4)).unproject(centers, np.ones((48, 64)))
    px, _ = camera.project(rays)
    inside = (px >= 0).all(-1) & (px < [40, 30]).all(-1)
    column, row = np.floor(px[inside]).astype(int).T
    np.testing.assert_array_equal(found[inside], depth[row, column])
    assert np.isnan(found[~inside]).all() and (~inside).any()


def test_poses_of_few_digits_are_made_rigid_and_others_refused() -> None:
    pose = look_at(np.array([1.0, 2.0, 0.5]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
    fixed = nearly_rigid(np.round(pose, 3), "pose")
    np.testing.assert_allclose(fixed[:3, :3] @ fixed[:3, :3].T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(fixed, pose, atol=2e-3)
    for wrong in (pose * 1.5, pose @ np.diag([1, 1, -1, 1]), pose * np.nan):
        with pytest.raises(CaptureError, match="pose"):
            nearly_rigid(wrong, "pose")
