"""Effects of materials, filters and motion: mirror, glass, highlight, flying pixels, motion blur."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.camera import pixel_centers
from digs_warp.sim.scene import Material
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.effects.flying_pixels import FlyingPixels
from digs_warp.sim.sensor.effects.mirror import Mirror
from digs_warp.sim.sensor.effects.motion_blur import MotionBlur
from digs_warp.sim.sensor.effects.specular import Specular, failure_shares
from digs_warp.sim.sensor.effects.transparency import Transparency
from digs_warp.sim.sensor.frame import FrameTruth, Motion, Sensed
from digs_warp.sim.sensor.virtual_image import curvature_along_rows, virtual_disparity
from reference.stereo_frames import CountedRays, broadband, flat, make_frame, make_rig
from reference.stereo_pairs import box_frame

CHROME = Material("chrome", np.ones(3), roughness=0.0, metallic=1.0)
GLAZE = Material("glaze", np.ones(3), roughness=0.1)
GLASS = Material("glass", np.ones(3), transmission=0.9)


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
    sensed = Mirror().apply(Sensed.of(truth), truth, np.random.default_rng(0))
    depth = truth.rig.focal_baseline / sensed.disparity
    np.testing.assert_allclose(depth, 5.5, rtol=1e-5)
    assert (sensed.cause == Cause.MIRROR).all()


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


def test_a_ball_of_chrome_shows_a_small_world_half_a_radius_behind_its_front() -> None:
    truth = with_material(sphere_frame(radius=0.2, distance=1.0), CHROME)
    sky = WallRays(truth, 1e4)
    disparity = virtual_disparity(replace(truth, rays=sky), np.isfinite(truth.depth))
    assert truth.rig.focal_baseline / disparity[120, 160] == pytest.approx(0.8 + 0.1, rel=0.01)


def test_other_materials_mirror_nothing_and_cast_no_ray() -> None:
    for material in (GLAZE, Material("steel", np.ones(3), roughness=0.4, metallic=1.0)):
        rays = CountedRays((240, 320))
        truth = replace(with_material(make_frame(25.0), material), rays=rays)
        assert Mirror().apply(Sensed.of(truth), truth, np.random.default_rng(0)).disparity is (
            truth.disparity
        )
        assert rays.asked == []


def test_glass_is_looked_through_as_often_as_it_lets_light_pass() -> None:
    shares = []
    for number in range(8):
        truth = with_material(make_frame(25.0), GLASS)
        sensed = Transparency().apply(Sensed.of(truth), truth, np.random.default_rng(number))
        through = sensed.cause == Cause.TRANSPARENT
        shares.append(through.mean())
        np.testing.assert_allclose(
            truth.rig.focal_baseline / sensed.disparity[through], 10.0, rtol=1e-6
        )
        assert (sensed.disparity[~through] == truth.disparity[~through]).all()
    assert np.mean(shares) == pytest.approx(0.9, abs=0.03)


def test_a_pane_in_front_of_part_of_the_view_changes_only_there() -> None:
    truth = make_frame(25.0)
    ids = np.full((240, 320), -1, dtype=np.int32)
    ids[50:100, 50:100] = 1
    truth = replace(truth, materials=(CHROME, GLASS), material_ids=ids)
    sensed = Transparency().apply(Sensed.of(truth), truth, np.random.default_rng(0))
    assert (sensed.cause != Cause.OK).any() and not (sensed.cause != Cause.OK)[ids != 1].any()


def glossy_frame(contrast: float) -> FrameTruth:
    """A glazed wall with a bright disc on it; its texture is that of broadband noise."""
    image = broadband((240, 320), 1, contrast) if contrast else flat((240, 320))
    rows, columns = np.indices((240, 320))
    disc = np.hypot(rows - 120, columns - 160) < 50
    image = np.where(disc[..., None], np.minimum(image.astype(int) + 80, 255), image).astype(
        np.uint8
    )
    return with_material(make_frame(25.0, image=image), GLAZE)


def test_highlights_on_plain_glaze_are_matched_at_their_virtual_image() -> None:
    truth = glossy_frame(0.0)
    sensed = Specular().apply(Sensed.of(truth), truth, np.random.default_rng(0))
    wrong = sensed.cause == Cause.SPECULAR
    bright = truth.gray > 150
    assert not (wrong & ~bright).any()
    # Shift 25 px - f b / (2 + 10) m = 21 px: 91 % were wrong in the measurement.
    assert wrong[bright].mean() == pytest.approx(0.91, abs=0.06)
    k = ray_lengths(truth)
    behind = truth.depth + 10.0 / k  # ten metres along the ray
    expected = truth.rig.focal_baseline / behind
    np.testing.assert_allclose(sensed.disparity[wrong], expected[wrong], rtol=1e-5)


def test_highlights_on_patterned_glaze_do_less_harm() -> None:
    shift = np.array([1.0, 2.0, 5.0, 10.0])
    weak_wrong, weak_holes = failure_shares(shift, 3.0)
    strong_wrong, strong_holes = failure_shares(shift, 20.0)
    np.testing.assert_allclose(weak_wrong, [0, 0.57, 0.79, 0.91])
    assert (strong_wrong[1:] < weak_wrong[1:]).all()
    assert (weak_holes == 0).all() and strong_holes[-1] == pytest.approx(0.2)


def test_flying_pixels_hang_between_near_and_far() -> None:
    truth, (rows, columns) = box_frame(30.0, 10.0)
    sensed = FlyingPixels().apply(Sensed.of(truth), truth, np.random.default_rng(0))
    flying = sensed.cause == Cause.FLYING
    values = sensed.disparity[flying]
    assert ((values > 10) & (values < 30)).all()
    assert (sensed.disparity[~flying] == truth.disparity[~flying]).all()
    outline = 2 * (rows.stop - rows.start) + 2 * (columns.stop - columns.start)
    assert flying.sum() / outline == pytest.approx(1.15, abs=0.1)


def test_small_steps_make_no_flying_pixels() -> None:
    truth, _ = box_frame(12.5, 10.0)
    sensed = FlyingPixels().apply(Sensed.of(truth), truth, np.random.default_rng(0))
    assert (sensed.cause == Cause.OK).all()


def blurred(pixels: float, axis: int = 0) -> tuple[Sensed, FrameTruth]:
    """A plane in a camera that moves so fast that the image moves ``pixels`` in an exposure."""
    rig = make_rig(exposure_time=0.01)
    velocity = [0.0, 0.0, 0.0]
    velocity[axis] = pixels / (500.0 / 2.0) / 0.01  # u = f v / Z
    truth = make_frame(25.0, rig, motion=Motion((velocity[0], velocity[1], 0.0), (0.0, 0.0, 0.0)))
    return MotionBlur().apply(Sensed.of(truth), truth, np.random.default_rng(0)), truth


@pytest.mark.parametrize(("pixels", "rms"), [(9.5, 0.19), (15.0, 0.24), (25.0, 0.35)])
def test_blur_along_rows_adds_the_measured_error(pixels: float, rms: float) -> None:
    sensed, truth = blurred(pixels)
    error = sensed.disparity - truth.disparity
    assert np.hypot(error.std(), 0.13) == pytest.approx(rms, rel=0.15)
    assert (sensed.cause == Cause.OK).all()


def test_long_blur_leads_to_wrong_matches() -> None:
    sensed, truth = blurred(41.0)
    wrong = sensed.cause == Cause.MOTION
    assert wrong.mean() == pytest.approx(0.11, abs=0.04)
    assert (np.abs(sensed.disparity - truth.disparity)[wrong] > 1).all()


def test_short_blur_and_blur_along_columns_do_no_harm() -> None:
    for sensed, truth in (blurred(8.0), blurred(41.0, axis=1)):
        assert sensed.disparity is truth.disparity
