"""An infrared pair: the dots of its projector, and its depth in the image of the color camera."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree  # pyright: ignore[reportAttributeAccessIssue]

from digs_warp.geometry.camera import Camera, pixel_centers
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.camera.shutter import Shutter
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Scene
from digs_warp.sim.sensor.color import PIXEL_EFFECTS, PROJECTOR
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.facts import measure_facts
from digs_warp.sim.sensor.frame import Cause, FrameTruth, Sensed
from digs_warp.sim.sensor.infrared.pair import (
    DENSITY,
    FIELD_DEG,
    LEAST_DISTANCE,
    with_dots,
)
from digs_warp.sim.sensor.infrared.registration import ColorView, registered, sources_of
from digs_warp.sim.sensor.tiers import Tier, sense
from reference.infrared_scenes import (
    ROOM,
    WHITE,
    dots_of_pattern,
    infrared_rig,
    matte_share,
    spots_at,
    still_session,
    wall,
)
from reference.plates import plate
from reference.registration_twin import register

RIG = infrared_rig(color_offset=0.0)  # the left eye is in the origin
PLACE = RIG.projector_offset
PROJECTOR_POSE = Camera(RIG.intrinsics, np.eye(4)).shifted_right(PLACE).world_from_cam


def light_of(scene: Scene, rig: StereoRig = RIG, eye: float = 0.0) -> np.ndarray:
    """What the projector adds to the image of an eye ``eye`` metres to the right of the left one."""
    renderer = still_session(scene, rig).renderer
    assert isinstance(renderer, RaycastRenderer)
    camera = Camera(rig.intrinsics, np.eye(4)).shifted_right(eye)
    return renderer.project_dots(camera, PROJECTOR_POSE).light


def test_the_pattern_has_the_density_and_the_distances_of_the_real_one() -> None:
    dots = dots_of_pattern()
    half = np.tan(np.deg2rad(FIELD_DEG) / 2)
    assert len(dots) == pytest.approx(DENSITY * 4 * half[0] * half[1], rel=1e-3)
    assert (np.abs(dots[:, :2]) <= half).all()
    nearest = KDTree(dots[:, :2]).query(dots[:, :2], k=2)[0][:, 1] * np.sqrt(DENSITY)
    assert nearest.min() >= LEAST_DISTANCE * (1 - 1e-5)
    # On the gray box of realsense_d435_ir_pair: 0.77, 0.85 and 1.0.
    np.testing.assert_allclose(np.percentile(nearest, [5, 50, 95]), [0.77, 0.83, 1.0], atol=0.03)
    assert dots[:, 2].mean() == pytest.approx(1, abs=1e-5)


@pytest.mark.parametrize("distance", [0.6, 1.7])
@pytest.mark.parametrize("eye", [0.0, 0.05])
def test_brightness_on_a_wall_follows_the_formula(distance: float, eye: float) -> None:
    light = light_of(wall(distance), eye=eye)
    k = RIG.intrinsics
    rng = np.random.default_rng(1)
    rows, columns = rng.integers(0, k.height, 400), rng.integers(0, k.width, 400)
    u, v = pixel_centers(k.width, k.height)[rows, columns].T
    place = np.stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones(400)], 1) * distance
    to_light = np.array([PLACE - eye, 0, 0]) - place
    x, y = -to_light[:, 0] / distance, -to_light[:, 1] / distance
    expected = spots_at(x, y, k.fx) / distance**2
    for i in range(400):
        light_way, eye_way = (d / np.linalg.norm(d) for d in (to_light[i], -place[i]))
        half = light_way + eye_way
        cosine = float(np.dot(light_way, half) / np.linalg.norm(half))
        share = matte_share(0.8, -light_way[2], -eye_way[2], cosine)
        expected[i] *= (
            share / -light_way[2]
        )  # a plane across the view is lit as brightly at its sides
    assert expected.max() > 0.1 / distance**2
    np.testing.assert_allclose(
        light[rows, columns], expected, rtol=3e-3, atol=1e-4 * expected.max()
    )


def test_a_near_thing_throws_a_shadow_on_the_side_that_the_projector_cannot_see() -> None:
    near, far = 0.5, 1.0
    # Its left edge is in the middle of the image; the projector sits to the right of the eye.
    screen = plate((0.2, 0, near), (0.2, 0, 0), (0, -2, 0), WHITE)
    scene = join_scenes(wall(far), screen)
    session = still_session(scene, RIG)
    camera = Camera(RIG.intrinsics, np.eye(4))
    peak = session.renderer.project_dots(camera, PROJECTOR_POSE).peak[120]
    width = RIG.intrinsics.fx * PLACE * (1 / near - 1 / far)
    dark = np.flatnonzero(peak == 0)
    assert dark.max() == RIG.intrinsics.width // 2 - 1
    assert len(dark) == pytest.approx(width, abs=1.01)


def sensed_wall(
    scene: Scene, tier: Tier, projects: bool = True, radiance: float = ROOM
) -> tuple[Sensed, FrameTruth]:
    """What the pair measures of a scene, with image noise."""
    session = still_session(scene, RIG, radiance)
    truth, _ = session.truth(0, Shutter(), projects=projects)
    noisy = recorded_images(truth, PIXEL_EFFECTS, seed=4, is_gray=True)
    return sense(truth, tier, recorded=noisy), truth


def filled(sensed: Sensed, truth: FrameTruth) -> float:
    """Share of right matches where both eyes see the wall."""
    columns = np.arange(truth.depth.shape[1])
    both = np.broadcast_to(truth.disparity < columns - 5, truth.depth.shape)
    return float(np.mean((np.abs(sensed.disparity - truth.disparity) <= 1)[both]))


@pytest.mark.parametrize("tier", ["guided", "matcher"])
def test_a_white_wall_has_depth_with_the_projector_and_none_without(tier: Tier) -> None:
    scene = wall(1.0)
    assert filled(*sensed_wall(scene, tier)) > 0.9
    assert filled(*sensed_wall(scene, tier, projects=False)) < 0.3


def test_bright_light_drowns_the_dots_and_the_plan_says_so() -> None:
    scene = wall(1.0)
    bright = 150 * ROOM
    sensed, truth = sensed_wall(scene, "guided", radiance=bright)
    assert filled(sensed, truth) < 0.3
    off = PROJECTOR.choose(measure_facts([truth], truth.rig), RIG)
    assert not off.on and "drowns" in off.reason
    _, indoors = sensed_wall(scene, "guided")
    assert PROJECTOR.choose(measure_facts([indoors], RIG), RIG).on
    # Twice as far away, a quarter of the light.
    share = [measure_facts([sensed_wall(wall(z), "guided")[1]], RIG).dot_share for z in (1.0, 8.0)]
    assert share[0] > 0.99 and share[1] < share[0]


def test_a_session_draws_the_dots_from_the_place_of_the_projector() -> None:
    rig = infrared_rig()
    session = still_session(wall(1.0, slope=0.5), rig)
    dark, _ = session.truth(0, Shutter(), projects=False)
    lit, _ = session.truth(0, Shutter())
    place = lit.camera.shifted_right(rig.projector_offset).world_from_cam
    np.testing.assert_allclose(lit.camera.center_world, [0.015, 0, 0], atol=1e-12)
    gain = np.float32(rig.projector_power * session.renderer.exposure)
    eyes = lit.camera, lit.camera.shifted_right(rig.baseline)
    for eye, before, after in zip(
        eyes, (dark.image, dark.right), (lit.image, lit.right), strict=True
    ):
        dots = session.renderer.project_dots(eye, place).light
        np.testing.assert_array_equal(after, with_dots(before, gain * dots))
        assert np.mean(after != before) > 0.1


NEAR, FAR = 0.5, 1.0


def taken(depth: np.ndarray, source: np.ndarray) -> np.ndarray:
    """The depth at the sources; NaN where there is none."""
    return np.where(source < 0, np.nan, depth.reshape(-1)[source])


@pytest.mark.parametrize(("zoom", "offset"), [(1.444, -0.015), (1.0, 0.02), (0.8, -0.03)])
def test_every_pixel_is_the_slow_twins(zoom: float, offset: float) -> None:
    rig = infrared_rig(22, color_zoom=zoom, color_offset=offset)
    shape = rig.intrinsics.height, rig.intrinsics.width
    rng = np.random.default_rng(3)
    depth = rng.choice([0.3, 0.31, 0.7, 1.9, np.nan, np.inf, -np.inf], shape).astype(np.float32)
    depth *= rng.uniform(0.99, 1.01, shape).astype(np.float32)
    found = taken(depth, sources_of(depth, rig))
    np.testing.assert_array_equal(found, register(depth, rig))
    assert 0.3 < np.isfinite(found).mean() < 1


def perfect(scene: Scene) -> tuple[Sensed, FrameTruth, ColorView]:
    """A scene as a perfect pair measures it."""
    session = still_session(scene, infrared_rig())
    truth, _ = session.truth(0, Shutter())
    return Sensed.of(truth), truth, session.color_view(0, Shutter())


def test_a_slanted_wall_is_where_the_color_camera_sees_it() -> None:
    sensed, truth, view = perfect(wall(FAR, slope=0.6))
    found = registered(sensed, truth, view)
    assert np.isfinite(found.depth).all()
    # Points go to where they are seen: a depth pixel is 1.44 color pixels wide.
    error = found.depth - view.depth
    per_pixel = np.abs(np.diff(view.depth, axis=1)).max()
    assert np.abs(error).max() <= 2.5 * per_pixel
    assert abs(error.mean()) < 0.6 * per_pixel
    # With the color camera on the other side of the eye, points would be 9 pixels away.
    turned = replace(truth, rig=replace(truth.rig, color_offset=-truth.rig.color_offset))
    wrong = np.abs(registered(sensed, turned, view).depth - view.depth)
    assert np.nanmedian(wrong) > 4 * np.median(np.abs(error))
    assert (found.cause == Cause.OK).mean() > 0.99


def test_a_near_thing_leaves_a_shadow_of_the_known_width_on_the_side_of_the_color_camera() -> None:
    screen = plate((0, 0, NEAR), (0.08, 0, 0), (0, -0.1, 0), WHITE)
    sensed, truth, view = perfect(join_scenes(wall(FAR), screen))
    found = registered(sensed, truth, view)
    row = found.depth[truth.depth.shape[0] // 2]
    empty = np.flatnonzero(np.isnan(row))
    rig = truth.rig
    width = rig.image_intrinsics.fx * abs(rig.color_offset) * (1 / NEAR - 1 / FAR)
    assert len(empty) == pytest.approx(width, abs=1.6)
    on_screen = np.flatnonzero(row < (NEAR + FAR) / 2)
    assert empty.max() == on_screen.min() - 1  # the color camera sits to the left of the eye
    assert (found.cause[truth.depth.shape[0] // 2, empty] == Cause.OCCLUDED).all()
    assert (found.confidence[truth.depth.shape[0] // 2, empty] == 0).all()
    # Near things grow by a pixel at most.
    truly = np.flatnonzero(view.depth[truth.depth.shape[0] // 2] < (NEAR + FAR) / 2)
    assert 0 <= truly.min() - on_screen.min() <= 2 and 0 <= on_screen.max() - truly.max() <= 2


def test_holes_confidence_and_causes_come_along() -> None:
    sensed, truth, view = perfect(wall(FAR))
    lost = np.zeros(truth.depth.shape, bool)
    lost[100:140, 180:230] = True
    near = np.zeros_like(lost)
    near[60:80, 180:230] = True
    sensed = replace(sensed, confidence=np.full(lost.shape, 0.25, np.float32))
    sensed = sensed.with_holes(lost, Cause.SPECULAR).with_holes(near, Cause.NEAR)
    found = registered(sensed, truth, view)
    assert np.isneginf(found.depth).sum() > 0.8 * near.sum() * truth.rig.color_zoom**2
    hole = np.isnan(found.depth)
    assert 0.8 < hole.sum() / (lost.sum() * truth.rig.color_zoom**2) <= 1
    assert (found.cause[hole] == Cause.SPECULAR).all()
    assert (found.confidence[~np.isfinite(found.depth)] == 0).all()
    assert (found.confidence[np.isfinite(found.depth)] == 0.25).all()
