"""Mirrors: where their image appears; filters: flying pixels."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.geometry.camera import pixel_centers
from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.guided.tier import curvature_along_rows, virtual_disparity
from reference.stereo_frames import CountedRays, make_frame

CHROME = Material("chrome", np.ones(3), roughness=0.0, metallic=1.0)


def with_material(truth: FrameTruth, material: Material) -> FrameTruth:
    return replace(truth, materials=(material,))


def ray_lengths(truth: FrameTruth) -> np.ndarray:
    """Distance from the eye over planar depth."""
    k = truth.camera.intrinsics
    px = pixel_centers(k.width, k.height)
    return np.sqrt(1 + ((px[..., 0] - k.cx) / k.fx) ** 2 + ((px[..., 1] - k.cy) / k.fy) ** 2)


class WallRays(CountedRays):
    """A wall parallel to the image, ``distance`` metres behind the camera's plane, in a mirror."""

    def __init__(self, truth: FrameTruth, distance: float) -> None:
        super().__init__(truth.depth.shape)
        self.length = (truth.depth + distance) * ray_lengths(truth)

    def reflection_distance(self, where: np.ndarray | None = None) -> np.ndarray:
        return self.length.astype(np.float32)


def test_a_plane_mirror_shows_the_virtual_image_behind_it() -> None:
    """A wall 1.5 m behind the camera, in a mirror 2 m before it, seems to be at 2 + (2 + 1.5) m."""
    truth = with_material(make_frame(25.0), CHROME)
    truth = replace(truth, rays=WallRays(truth, 1.5))
    disparity = virtual_disparity(truth, np.ones(truth.depth.shape, bool))
    np.testing.assert_allclose(truth.rig.focal_baseline / disparity, 5.5, rtol=1e-5)


def sphere_frame(radius: float, distance: float) -> FrameTruth:
    """A ball before the camera, as large as it looks; nothing round it."""
    truth = make_frame(10.0)
    k = truth.camera.intrinsics
    px = pixel_centers(k.width, k.height)
    rays = np.stack(
        [(px[..., 0] - k.cx) / k.fx, (px[..., 1] - k.cy) / k.fy, np.ones(px.shape[:2])], -1
    )
    a, b = (rays**2).sum(-1), rays[..., 2] * distance
    root = b * b - a * (distance**2 - radius**2)
    depth = np.where(root > 0, (b - np.sqrt(np.maximum(root, 0))) / a, np.nan)
    normals = (rays * depth[..., None] - (0, 0, distance)) / radius
    return replace(truth, depth=depth.astype(np.float32), normals_world=normals.astype(np.float32))


def test_the_curvature_of_a_ball_is_one_over_its_radius() -> None:
    truth = sphere_frame(radius=0.2, distance=1.0)
    rows, columns = np.nonzero(np.isfinite(truth.depth))
    curvature = curvature_along_rows(truth, rows, columns)
    middle = np.hypot(rows - 120, columns - 160) < 60
    np.testing.assert_allclose(curvature[middle], 5.0, rtol=0.02)
    # Also at the rim, where one neighbor shows something else.
    np.testing.assert_allclose(curvature[curvature > 0], 5.0, rtol=0.1)
    assert (curvature == 0).mean() < 0.005
    # It shows a small world half a radius behind its front.
    sky = replace(with_material(truth, CHROME), rays=WallRays(truth, 1e4))
    disparity = virtual_disparity(sky, np.isfinite(truth.depth))
    assert truth.rig.focal_baseline / disparity[120, 160] == pytest.approx(0.8 + 0.1, rel=0.01)
