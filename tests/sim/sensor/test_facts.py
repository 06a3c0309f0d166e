"""Facts of a scene, measured on frames of which they are known."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.facts import SceneFacts, measure_facts
from digs_warp.sim.sensor.frame import FrameTruth, Motion
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
