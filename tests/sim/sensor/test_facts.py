"""Facts of a scene, measured on frames of which they are known, and what the planner makes of them."""

from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pytest

from digs_warp.geometry.camera import Camera, pixel_centers
from digs_warp.geometry.rigid import rigid
from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.effects import EFFECTS
from digs_warp.sim.sensor.facts import SceneFacts, image_motion, measure_facts
from digs_warp.sim.sensor.frame import FrameTruth, Motion
from digs_warp.sim.sensor.planner import plan
from reference.stereo_frames import broadband, flat, make_frame, make_rig

SHAPE = (240, 320)


def facts_of(*frames: FrameTruth) -> SceneFacts:
    return measure_facts(frames, frames[0].rig)


def square(near: float, far: float) -> np.ndarray:
    """A near square of 80 x 120 px, rows 80 to 160, columns 100 to 220."""
    disparity = np.full(SHAPE, far)
    disparity[80:160, 100:220] = near
    return disparity


def test_exposure_is_counted_where_something_is_in_view() -> None:
    disparity, image = np.full(SHAPE, 30.0), broadband(SHAPE)
    image[:24], image[24:36] = 255, 3
    disparity[:, 160:], image[:, 160:] = np.nan, 255
    facts = facts_of(make_frame(disparity, image=image))
    assert facts.saturated_share == pytest.approx(0.1)
    assert facts.dark_share == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("material", "fact"),
    [
        (Material("chrome", np.ones(3), roughness=0.05, metallic=1.0), "mirror_share"),
        (Material("glass", np.ones(3), transmission=1.0), "transparent_share"),
    ],
)
def test_materials_are_counted(material: Material, fact: str) -> None:
    truth = make_frame(30.0)
    ids = np.zeros(SHAPE, dtype=np.int32)
    ids[:60] = 1
    ids[200:] = -1  # the surround
    facts = asdict(
        facts_of(replace(truth, material_ids=ids, materials=(*truth.materials, material)))
    )
    assert facts[fact] == pytest.approx(0.25)
    assert sum(facts[f"{kind}_share"] for kind in ("mirror", "transparent")) == 0.25


def test_blur_and_skew_are_motion_times_time() -> None:
    rig = make_rig(exposure_time=0.02, readout_time=0.05)
    sideways = facts_of(make_frame(50.0, rig, motion=Motion((0.3, 0, 0), (0, 0, 0))))
    # f v / Z = 500 * 0.3 / 1 px/s
    assert sideways.blur_px == pytest.approx(3.0, rel=1e-3)
    assert sideways.skew_px == pytest.approx(7.5, rel=1e-3)


def test_facts_are_means_and_extremes_over_the_frames() -> None:
    white = flat(SHAPE, 255)
    plane, step = make_frame(30.0), make_frame(square(50, 10), image=white, number=1)
    single, both = facts_of(step), facts_of(plane, step)
    assert both.saturated_share == pytest.approx(single.saturated_share / 2)
    assert single.saturated_share == 1
    assert both.min_depth == single.min_depth
    assert facts_of(step, plane) == both


def test_an_empty_frame_has_no_range_and_no_shares() -> None:
    facts = facts_of(make_frame(np.nan))
    assert np.isnan([facts.min_depth, facts.max_depth]).all()
    assert facts.saturated_share == facts.dark_share == 0
    assert facts_of(make_frame(np.nan), make_frame(30.0)) == replace(
        facts_of(make_frame(30.0)), frames=2
    )


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


NAMES = [effect.name for effect in EFFECTS]

# A well lit, well textured, matt wall far away and a rig without faults: nothing to simulate.
QUIET = SceneFacts(
    frames=1,
    min_depth=9.0,
    max_depth=11.0,
    mirror_share=0.0,
    transparent_share=0.0,
    saturated_share=0.0,
    dark_share=0.0,
    color_cast=0.0,
    blurred_share=0.0,
    skewed_share=0.0,
    blur_px=0.1,
    skew_px=0.1,
)
FAULTLESS = make_rig(max_depth=1e6)


def effects_on(facts: SceneFacts, rig: Any = FAULTLESS, selection: Any = "auto") -> set[str]:
    return {choice.effect for choice in plan(facts, rig, selection) if choice.on}


@pytest.mark.parametrize(
    ("changes", "effect"),
    [({"mirror_share": 0.01}, "mirror"), ({"transparent_share": 0.01}, "transparency")],
)
def test_each_effect_is_switched_on_by_its_fact(changes: dict[str, float], effect: str) -> None:
    assert effects_on(replace(QUIET, **changes)) == {effect}
    slight = dict.fromkeys(changes, 0.0005)
    assert effects_on(replace(QUIET, **slight)) == set()


@pytest.mark.parametrize(
    ("changes", "effect"),
    [
        ({"disparity_step": 0.1}, "quantum"),
        ({"static_field": 0.1}, "static-field"),
    ],
)
def test_each_fault_of_the_rig_switches_on_its_effect(
    changes: dict[str, float], effect: str
) -> None:
    assert effects_on(QUIET, replace(FAULTLESS, **changes)) == {effect}


def test_selection_overrides_the_facts_and_says_so() -> None:
    assert effects_on(QUIET, selection="all") == set(NAMES)
    assert effects_on(QUIET, load_profile("zed2-720").rig(), "none") == set()
    assert effects_on(QUIET, selection="quantum, mirror") == {"quantum", "mirror"}
    assert effects_on(QUIET, selection=["quantum"]) == {"quantum"}
    choices = {choice.effect: choice for choice in plan(QUIET, FAULTLESS, "mirror")}
    assert choices["mirror"].reason.startswith("asked for")
    assert not choices["quantum"].reason.startswith("left out")  # it would have been off anyway
