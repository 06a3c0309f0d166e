"""Facts of a scene, measured on frames of which they are known."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.sim.scene import Material
from digs_warp.sim.sensor.facts import SceneFacts, measure_facts
from digs_warp.sim.sensor.frame import FrameTruth, Motion
from reference.stereo_frames import broadband, flat, make_frame, make_rig

SHAPE = (240, 320)
AREA = SHAPE[0] * SHAPE[1]


def facts_of(*frames: FrameTruth) -> SceneFacts:
    return measure_facts(frames)


def square(near: float, far: float) -> np.ndarray:
    """A near square of 80 x 120 px, rows 80 to 160, columns 100 to 220."""
    disparity = np.full(SHAPE, far)
    disparity[80:160, 100:220] = near
    return disparity


def test_range_and_disparity_belong_together() -> None:
    facts = facts_of(make_frame(square(50.0, 10.0)), make_frame(25.0, number=1))
    assert facts.frames == 2
    assert (facts.min_disparity, facts.max_disparity) == pytest.approx((10, 50))
    assert (facts.min_depth, facts.max_depth) == pytest.approx((1, 5))


def test_a_textured_plane_has_nothing_to_report() -> None:
    facts = asdict(facts_of(make_frame(30.0)))
    silent = {name for name, value in facts.items() if name.endswith("_share") and value == 0}
    assert silent == {name for name in facts if name.endswith("_share")}
    assert facts["blur_px"] == facts["skew_px"] == facts["highlight_shift"] == 0
    assert facts["texture_rms"] > 2


@pytest.mark.parametrize("radius", [15, 30, 60])
def test_textureless_radius_is_that_of_a_plain_disc(radius: float) -> None:
    y, x = np.mgrid[:240, :320]
    image = broadband(SHAPE)
    image[np.hypot(x - 160, y - 120) < radius] = 128
    facts = facts_of(make_frame(30.0, image=image))
    # The window reaches 2 px into the disc, the gradient one more.
    assert facts.textureless_radius == pytest.approx(radius - 3, abs=1.5)
    beyond = max(0, radius - 23) ** 2 * np.pi / AREA
    assert facts.textureless_share == pytest.approx(beyond, abs=0.006)


def test_without_any_texture_the_radius_ends_with_the_image() -> None:
    facts = facts_of(make_frame(30.0, image=flat(SHAPE)))
    assert facts.textureless_radius == pytest.approx(400)  # the diagonal of 320 x 240
    assert facts.textureless_share == facts.weak_texture_share == 1


def test_weak_texture_depends_on_the_image_noise() -> None:
    image = broadband(SHAPE, contrast=10)
    weak = [facts_of(make_frame(30.0, make_rig(image_noise=n), image)) for n in (0.5, 4, 32)]
    shares = [facts.weak_texture_share for facts in weak]
    assert shares[0] < 0.01 and shares[2] > 0.99 and shares == sorted(shares)


def test_steps_are_counted_by_size() -> None:
    outline = 2 * (80 + 120)
    small, large = (facts_of(make_frame(square(30 + s, 30.0))) for s in (2.0, 10.0))
    # Two pixels to either side of the outline and the pixel at it: 3 + 3.
    for facts in (small, large):
        assert facts.step_share == pytest.approx(6 * outline / AREA, rel=0.05)
    assert small.large_step_share == 0
    assert large.large_step_share == large.step_share


@pytest.mark.parametrize("jump", [5.0, 20.0])
def test_occluded_share_is_the_height_of_a_step_times_its_jump(jump: float) -> None:
    facts = facts_of(make_frame(square(20.0 + jump, 20.0)))
    assert facts.occluded_share == pytest.approx(80 * jump / AREA, rel=0.25)


def test_contrast_at_steps_tells_which_side_is_textured() -> None:
    strong, weak = broadband(SHAPE, contrast=60), broadband(SHAPE, contrast=8)
    mask = square(1, 0)[..., None] > 0
    near_strong = facts_of(make_frame(square(40, 20), image=np.where(mask, strong, weak)))
    near_weak = facts_of(make_frame(square(40, 20), image=np.where(mask, weak, strong)))
    assert near_strong.step_contrast > 1 > -1 > near_weak.step_contrast


def test_grazing_share_is_that_of_the_steep_part() -> None:
    disparity = np.full(SHAPE, 30.0)
    disparity[:60] = 30 + 0.4 * np.arange(320.0)
    assert facts_of(make_frame(disparity)).grazing_share == pytest.approx(0.25, abs=0.01)
    disparity[:60] = 30 + 0.2 * np.arange(320.0)
    assert facts_of(make_frame(disparity)).grazing_share == 0


def test_exposure_is_counted() -> None:
    image = broadband(SHAPE)
    image[:24], image[24:36] = 255, 3
    facts = facts_of(make_frame(30.0, image=image))
    assert facts.saturated_share == pytest.approx(0.1)
    assert facts.dark_share == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("material", "fact"),
    [
        (Material("lacquer", np.ones(3), roughness=0.2), "specular_share"),
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
    assert sum(facts[f"{kind}_share"] for kind in ("specular", "mirror", "transparent")) == 0.25


def test_blur_and_skew_are_motion_times_time() -> None:
    rig = make_rig(exposure_time=0.02, readout_time=0.05)
    sideways = facts_of(make_frame(50.0, rig, motion=Motion((0.3, 0, 0), (0, 0, 0))))
    # f v / Z = 500 * 0.3 / 1 px/s
    assert sideways.blur_px == pytest.approx(3.0, rel=1e-3)
    assert sideways.skew_px == pytest.approx(7.5, rel=1e-3)


def test_facts_are_means_and_extremes_over_the_frames() -> None:
    plane, step = make_frame(30.0), make_frame(square(50, 10), number=1)
    single, both = facts_of(step), facts_of(plane, step)
    assert both.step_share == pytest.approx(single.step_share / 2)
    assert both.max_disparity == single.max_disparity
    assert facts_of(step, plane) == both


def test_what_is_not_in_view_is_not_counted() -> None:
    half = np.where(np.arange(320) < 160, 30.0, np.nan)[None]
    image = broadband(SHAPE)
    image[:, 160:] = 255
    assert facts_of(make_frame(half, image=image)).saturated_share == 0


def test_an_empty_frame_has_no_range_and_no_shares() -> None:
    facts = facts_of(make_frame(np.nan))
    assert np.isnan([facts.min_depth, facts.max_depth, facts.max_disparity]).all()
    assert facts.step_share == facts.textureless_radius == 0
    assert facts_of(make_frame(np.nan), make_frame(30.0)) == replace(
        facts_of(make_frame(30.0)), frames=2
    )


def test_no_frames_are_refused() -> None:
    with pytest.raises(DigsError, match="no frames"):
        measure_facts([])
