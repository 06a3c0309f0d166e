"""Image motion against projection."""

import numpy as np

from digs_warp.geometry.camera import Camera, pixel_centers
from digs_warp.geometry.rigid import rigid
from digs_warp.sim.sensor.facts import image_motion
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
