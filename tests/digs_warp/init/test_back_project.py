"""Back-projection undoes projection."""

import numpy as np

from digs_warp.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry import look_at
from digs_warp.init.back_project import back_project

CAMERA = Camera(
    Intrinsics(31, 17, 40.0, 42.0, 14.0, 9.5),
    look_at(np.array([0.6, -0.5, 0.4]), np.zeros(3), np.array([0.0, 0.0, 1.0])),
)


def test_projecting_the_points_gives_pixels_and_depths_back() -> None:
    rng = np.random.default_rng(0)
    depth = rng.uniform(0.3, 3.0, (17, 31)).astype(np.float32)
    keep = rng.random((17, 31)) < 0.5
    image = rng.integers(0, 256, (17, 31, 3), dtype=np.uint8)
    points_world, colors = back_project(CAMERA, image, depth, keep)
    px, projected_depth = CAMERA.project(points_world)
    # float64 throughout: what remains is rounding at a magnitude of 31 pixels.
    np.testing.assert_allclose(px, pixel_centers(31, 17)[keep], atol=1e-12)
    np.testing.assert_allclose(projected_depth, depth[keep], rtol=1e-14)
    np.testing.assert_array_equal(colors * 255, image[keep])


def test_a_plane_stays_a_plane() -> None:
    depth = np.full((17, 31), 1.25, dtype=np.float32)
    points_world, _ = back_project(
        CAMERA, np.zeros((17, 31, 3), np.uint8), depth, np.ones((17, 31), bool)
    )
    forward = CAMERA.world_from_cam[:3, 2]
    np.testing.assert_allclose((points_world - CAMERA.center_world) @ forward, 1.25, rtol=1e-14)


def test_nothing_kept_gives_no_points() -> None:
    depth = np.full((17, 31), np.nan, dtype=np.float32)
    points_world, colors = back_project(
        CAMERA, np.zeros((17, 31, 3), np.uint8), depth, np.zeros((17, 31), bool)
    )
    assert points_world.shape == colors.shape == (0, 3)
