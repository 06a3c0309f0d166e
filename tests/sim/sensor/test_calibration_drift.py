"""A drifted calibration: against projected points, a really turned camera, and through both matchers."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.ndimage import map_coordinates

from digs_warp.data.capture import read_capture
from digs_warp.geometry.camera import Intrinsics, pixel_centers
from digs_warp.record.files import read_json
from digs_warp.sim.camera.shutter import Shutter
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.frame_maker import FrameMaker
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.record import simulate
from digs_warp.sim.record.sensor_plan import make_plan
from digs_warp.sim.record.session import prepare_session
from digs_warp.sim.sensor.color import CALIBRATION_DRIFT
from digs_warp.sim.sensor.color.rendering import corner_shift
from digs_warp.sim.sensor.drift import NO_DRIFT, Drift
from digs_warp.sim.sensor.facts import measure_facts
from digs_warp.sim.sensor.frame import Cause, FrameTruth
from digs_warp.sim.sensor.tiers import depth_of, sense
from reference.stereo_frames import broadband, make_frame, make_rig

LARGE = Drift(pitch_deg=-0.7, yaw_deg=1.1, roll_deg=0.9, focal=0.013, baseline=0.02)
K = Intrinsics(640, 400, 520.0, 510.0, 331.0, 190.0)


def seen_by_turned_eye(points: np.ndarray, drift: Drift, k: Intrinsics) -> np.ndarray:
    """Pixels of points in the axes that the camera believes in, (n, 3), float64, from first principles."""
    x, y, z = np.deg2rad([drift.pitch_deg, drift.yaw_deg, drift.roll_deg])
    axes = expm(np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]))  # columns: the eye's axes
    own = np.stack([points @ axes[:, i] for i in range(3)], axis=1)
    grown = 1 + drift.focal
    u = k.fx * grown * own[:, 0] / own[:, 2] + k.cx
    v = k.fy * grown * own[:, 1] / own[:, 2] + k.cy
    return np.stack([u, v], axis=1)


def test_the_shown_disparity_is_that_of_the_projected_points() -> None:
    """Points of the left image, lifted to their depth, seen by the right eye where it really is."""
    rig = replace(make_rig(K.width, K.height), intrinsics=K)
    disparity = np.random.default_rng(1).uniform(3, 90, (K.height, K.width)).astype(np.float32)
    disparity[7, 9] = np.nan
    shown = LARGE.shown_disparity(disparity, K)
    pixels = pixel_centers(K.width, K.height)
    depth = rig.focal_baseline / disparity.astype(np.float64)
    points = np.stack(
        [
            (pixels[..., 0] - K.cx) / K.fx * depth - rig.baseline,
            (pixels[..., 1] - K.cy) / K.fy * depth,
            depth,
        ],
        axis=-1,
    )
    landed = seen_by_turned_eye(points.reshape(-1, 3), LARGE, K)[:, 0].reshape(depth.shape)
    np.testing.assert_allclose(shown, pixels[..., 0] - landed, atol=1e-3)
    assert np.isnan(shown[7, 9])
    assert NO_DRIFT.shown_disparity(disparity, K) is disparity


def test_the_rendered_image_is_the_warped_one() -> None:
    """The right image of a really turned camera is the homography of the other one."""
    config = SimulateConfig(
        profile="bare-matcher", width=320, samples_per_pixel=16, frames=3, tier="guided"
    )
    session = prepare_session(config, load_inputs(config))
    drift = Drift(pitch_deg=0.3, yaw_deg=-0.4, roll_deg=0.5, focal=0.01)
    straight, turned = (session.truth(1, Shutter(), d)[0] for d in (NO_DRIFT, drift))
    np.testing.assert_array_equal(straight.image, turned.image)
    np.testing.assert_array_equal(straight.depth, turned.depth)
    k = session.rig.intrinsics
    # OpenCV's first pixel center is (0, 0), ours is (0.5, 0.5).
    half = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
    matrix = np.linalg.inv(half) @ drift.homography(k) @ half
    warped = cv2.warpPerspective(straight.right, matrix, (k.width, k.height), flags=cv2.INTER_CUBIC)
    inside = (slice(8, -8), slice(8, -8))
    error = np.abs(warped[inside].astype(float) - turned.right[inside]).mean()
    assert error < 0.25 * np.abs(straight.right[inside].astype(float) - turned.right[inside]).mean()


def slanted_pair(drift: Drift) -> FrameTruth:
    """A slanted plane, whose disparity passes through all fractions, and its drifted right image."""
    rig = make_rig(480, 360)
    k = rig.intrinsics
    level, along, downward = 24.3, 0.021, 0.013
    u, v = np.moveaxis(pixel_centers(k.width, k.height), -1, 0)
    left = broadband((k.height, k.width), 5)
    # Where the right image's pixels belong, and which pixels of the left image show the same points.
    belongs = np.linalg.inv(drift.homography(k)) @ np.stack([u, v, np.ones_like(u)]).reshape(3, -1)
    x, y = (belongs[:2] / belongs[2]).reshape(2, *u.shape)
    column = (x + level + downward * y) / (1 - along)
    gray = map_coordinates(
        left[..., 0].astype(float), [y - 0.5, column - 0.5], order=5, mode="mirror"
    )
    right = np.repeat(np.clip(np.rint(gray), 0, 255).astype(np.uint8)[..., None], 3, axis=2)
    truth = make_frame(level + along * u + downward * v, rig, left)
    return replace(truth, right=right, drift=drift)


@pytest.mark.parametrize("tier", ["guided", "matcher"])
def test_the_bias_depends_on_the_place_as_the_formula_says(tier: str) -> None:
    drift = Drift(yaw_deg=0.08, roll_deg=0.03, focal=0.003)
    truth = slanted_pair(drift)
    error = sense(truth, tier).disparity - truth.disparity  # pyright: ignore[reportArgumentType]
    k = truth.rig.intrinsics
    u, v = np.moveaxis(pixel_centers(k.width, k.height), -1, 0)
    # First order: a turn shifts by f (1 + x^2) and y, the focal length by x from the middle.
    x, y = (u - truth.disparity - k.cx) / k.fx, (v - k.cy) / k.fx
    yaw, roll = np.deg2rad([drift.yaw_deg, drift.roll_deg])
    formula = k.fx * (yaw * (1 + x**2) - roll * y - drift.focal * x)
    np.testing.assert_allclose(truth.shown_disparity - truth.disparity, formula, atol=0.005)
    inside = slice(20, -20), slice(60, -20)
    assert np.ptp(formula[inside]) > 0.8
    assert np.isfinite(error[inside]).mean() > 0.97
    near = np.abs(error - formula)[inside] < 1  # pixel locking alone moves by up to .3 px
    slope, offset = np.polyfit(formula[inside][near], error[inside][near], 1)
    assert (slope, offset) == (pytest.approx(1, abs=0.06), pytest.approx(0, abs=0.03))


def test_the_guided_search_looks_where_the_drifted_pair_shows_the_surface() -> None:
    """A shift of 30 px: round the true disparity, half of these pixels would find nothing."""
    truth = slanted_pair(Drift(yaw_deg=3.5))
    middle = slice(120, 240), slice(180, 360)
    off = np.abs(sense(truth, "guided").disparity - truth.shown_disparity)[middle]
    assert (off <= 1).mean() > 0.99


@pytest.mark.parametrize("tier", ["guided", "matcher"])
def test_a_changed_baseline_scales_depth(tier: str) -> None:
    truth = slanted_pair(NO_DRIFT)
    stretched = replace(truth, drift=Drift(baseline=0.01))
    plain, scaled = (
        depth_of(sense(frame, tier), frame)  # pyright: ignore[reportArgumentType]
        for frame in (truth, stretched)
    )
    both = np.isfinite(plain) & np.isfinite(scaled)
    assert both.mean() > 0.9
    np.testing.assert_allclose(plain[both] / scaled[both], 1.01, rtol=1e-5)


@pytest.mark.parametrize("tier", ["guided", "matcher"])
def test_misaligned_rows_make_holes_and_drifted_columns_wrong_depth(tier: str) -> None:
    fills = []
    for rows in (0.0, 1.0, 3.5):
        truth = slanted_pair(Drift(pitch_deg=float(np.rad2deg(rows / 500))))
        sensed = sense(truth, tier)  # pyright: ignore[reportArgumentType]
        fills.append(np.isfinite(sensed.disparity[20:-20, 60:-20]).mean())
    assert fills[0] > 0.97 and fills[1] > 0.95 and fills[2] < 0.6
    failed = ~(np.abs(sensed.disparity - truth.disparity) <= 1)[20:-20, 60:-20]
    assert (sensed.cause[20:-20, 60:-20][failed] == Cause.RECTIFICATION).mean() > 0.95

    yawed = sense(slanted_pair(Drift(yaw_deg=0.25)), tier)  # pyright: ignore[reportArgumentType]
    assert (yawed.cause[20:-20, 60:-20] == Cause.RECTIFICATION).mean() > 0.95


def test_the_drift_belongs_to_seed_and_unit_and_has_the_stated_size() -> None:
    rig = make_rig(rotation_drift=0.02, focal_drift=3e-4, baseline_drift=5e-4)
    draw = CALIBRATION_DRIFT.draw
    assert draw(rig, 7) == draw(rig, 7)
    assert len({draw(rig, 7), draw(rig, 8), draw(replace(rig, unit=1), 7)}) == 3
    assert draw(rig, 7, 0.0) == NO_DRIFT
    drawn = [draw(rig, seed) for seed in range(4000)]
    for name in ("pitch_deg", "yaw_deg", "roll_deg", "focal", "baseline"):
        sd = {"focal": 3e-4, "baseline": 5e-4}.get(name, 0.02)
        values = np.array([getattr(drift, name) for drift in drawn])
        assert values.std() == pytest.approx(sd, rel=0.05)
        assert abs(values.mean()) < 0.08 * sd
        assert getattr(draw(rig, 3, 2.0), name) == pytest.approx(2 * getattr(draw(rig, 3), name))


def test_the_rule_weighs_the_shift_in_the_corner_and_the_scale() -> None:
    turn, grown = np.deg2rad(0.02), 3e-4
    rig = make_rig(640, 480, rotation_drift=0.02, focal_drift=grown)
    x, y, f = 320.0, 240.0, 500.0
    turns = 2 * (x * y / f) ** 2 + (f + y * y / f) ** 2 + (f + x * x / f) ** 2 + x * x + y * y
    expected = np.sqrt(turn**2 * turns + grown**2 * (x * x + y * y))
    assert corner_shift(rig) == pytest.approx(expected, rel=2e-3)

    facts = measure_facts([make_frame(50.0)], make_rig())
    cases: list[tuple[dict[str, Any], bool]] = [
        ({}, False),
        ({"rotation_drift": 0.02}, True),
        ({"rotation_drift": 0.001}, False),
        ({"focal_drift": 5e-4}, True),
        ({"baseline_drift": 5e-4}, False),  # 0.025 px at 50 px
        ({"baseline_drift": 2e-3}, True),
    ]
    for figures, on in cases:
        assert CALIBRATION_DRIFT.choose(facts, make_rig(**figures)).on == on


def test_a_recording_has_one_drift_and_tells_it(tmp_path: Path) -> None:
    config = SimulateConfig(
        profile="bare-matcher", frames=2, width=96, samples_per_pixel=1, seed=4, tier="guided", strength=10.0,
        effects="calibration-drift",
    )  # fmt: skip
    session = prepare_session(config, load_inputs(config))
    capture = simulate(config, tmp_path / "capture", session=session)
    maker = FrameMaker(session, make_plan(session))
    drifts = [maker.render(number).truth.drift for number in (1, 0)]
    expected = CALIBRATION_DRIFT.draw(maker.session.rig, 4, 10.0)
    assert drifts == [expected, expected]
    sensor = read_capture(tmp_path / "capture").about.sensor
    assert sensor is not None and Drift(**sensor["drift"]) == expected
    plan = read_json(tmp_path / "capture" / "sensor_plan.json", "plan")
    assert Drift(**plan["drift"]) == expected
    assert capture.about.effects == ("calibration-drift",)
