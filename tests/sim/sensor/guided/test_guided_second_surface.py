"""Glass and mirrors: the search tries the second surface, and the images decide which one it finds."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from digs_warp.geometry.camera import pixel_centers
from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.drift import Drift
from digs_warp.sim.sensor.effects import SECOND_SURFACE_NAMES
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.guided.tier import (
    curvature_along_rows,
    second_disparity,
    sense_by_guided_matching,
    virtual_disparity,
)
from digs_warp.sim.sensor.tiers import sense_by_matching
from reference.stereo_frames import CountedRays, broadband, make_frame, make_rig
from reference.stereo_pairs import shifted_right_eye

CHROME = Material("chrome", np.ones(3), roughness=0.0, metallic=1.0)
GLASS = Material("glass", np.ones(3), transmission=0.9)
SHAPE = (120, 320)
SURFACE, BEHIND = 60.0, 21.25  # disparities [px]


class Rays(CountedRays):
    """Something at ``BEHIND`` shows through, and is reflected by a mirror parallel to the image."""

    def __init__(self, truth: FrameTruth) -> None:
        super().__init__(truth.depth.shape)
        behind = truth.rig.focal_baseline / BEHIND
        self.behind = np.full(self.shape, behind, np.float32)
        k = truth.camera.intrinsics
        y, x = (np.indices(self.shape) + 0.5) - np.array([k.cy, k.cx])[:, None, None]
        self.length = (behind - truth.depth) * np.sqrt(1 + (x / k.fx) ** 2 + (y / k.fy) ** 2)

    def reflection_distance(self, where: np.ndarray | None = None) -> np.ndarray:
        self.asked.append("reflection_distance")
        return self.length.astype(np.float32)

    def depth_behind(self, where: np.ndarray | None = None) -> np.ndarray:
        self.asked.append("depth_behind")
        return self.behind


def fine_texture(seed: int) -> np.ndarray:
    """A texture of nothing but details, which a coarse search does not see; round 0, [DN]."""
    texture = broadband(SHAPE, seed)[..., 0].astype(np.float64)
    return texture - gaussian_filter(texture, 1.2)


def layered_frame(material: Material, share: float) -> FrameTruth:
    """A pane in front of a wall; ``share`` of the contrast is the pane's."""
    truth = make_frame(SURFACE, make_rig(*SHAPE[::-1]))
    eyes = []
    for shift in (lambda image, _: image, shifted_right_eye):
        layers = [
            factor * (shift(_picture(seed), disparity)[..., 0] - 128.0)
            for seed, disparity, factor in ((1, SURFACE, share), (2, BEHIND, 1 - share))
        ]
        gray = np.clip(np.rint(128 + sum(layers)), 0, 255).astype(np.uint8)
        eyes.append(np.repeat(gray[..., None], 3, axis=2))
    truth = replace(truth, image=eyes[0], right=eyes[1], materials=(material,))
    return replace(truth, rays=Rays(truth))


def _picture(seed: int) -> np.ndarray:
    gray = np.clip(np.rint(128 + 3 * fine_texture(seed)), 0, 255).astype(np.uint8)
    return np.repeat(gray[..., None], 3, axis=2)


def shares(disparity: np.ndarray) -> tuple[float, float]:
    """Return how much of the image shows the surface, and what lies behind it."""
    inside = disparity[:, int(SURFACE) + 8 :]
    surface, behind = (np.mean(np.abs(inside - d) < 0.5) for d in (SURFACE, BEHIND))
    return float(surface), float(behind)


@pytest.mark.parametrize("material", [CHROME, GLASS])
def test_the_second_surface_is_found_where_a_full_search_finds_it(material: Material) -> None:
    truth = layered_frame(material, 0.1)
    full = shares(sense_by_matching(truth).disparity)
    found = shares(sense_by_guided_matching(truth).disparity)
    assert full[1] > 0.9
    assert found == pytest.approx(full, abs=0.03)
    missed = shares(sense_by_guided_matching(truth, effects=frozenset()).disparity)
    assert missed[1] < 0.7, "or the coarse search is enough"


def test_second_disparity_is_that_of_the_formulas_and_of_the_drifted_images() -> None:
    for material, kind in ((CHROME, "mirror"), (GLASS, "transparency")):
        truth = layered_frame(material, 0.5)
        second = second_disparity(truth, SECOND_SURFACE_NAMES)
        assert second is not None
        np.testing.assert_allclose(second, BEHIND, rtol=1e-4)
        assert second_disparity(truth, SECOND_SURFACE_NAMES - {kind}) is None
        drifted = replace(truth, drift=Drift(yaw_deg=0.1))
        shown = second_disparity(drifted, SECOND_SURFACE_NAMES)
        expected = drifted.drift.shown_disparity(second, truth.rig.intrinsics)
        np.testing.assert_array_equal(shown, expected)
        assert np.abs(expected - BEHIND).max() > 0.5


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
    rays = Rays(truth)
    rays.length = np.full(rays.shape, 1e4)
    sky = replace(truth, materials=(CHROME,), rays=rays)
    disparity = virtual_disparity(sky, np.isfinite(truth.depth))
    assert truth.rig.focal_baseline / disparity[120, 160] == pytest.approx(0.8 + 0.1, rel=0.01)
