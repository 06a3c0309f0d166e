"""Labels of failed matches: each cause alone, and which of several wins."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.drift import Drift
from digs_warp.sim.sensor.error_attribution import attribute_errors
from digs_warp.sim.sensor.frame import Cause, FrameTruth
from reference.stereo_frames import PLAIN, broadband, make_frame, make_rig

SHAPE = (60, 160)
MATERIALS = (
    PLAIN,
    Material("gloss", np.ones(3), roughness=0.1),
    Material("glass", np.ones(3), transmission=1.0),
    Material("chrome", np.ones(3), metallic=1.0, roughness=0.0),
)
DARK, WEAK = 5, 100  # gray levels of plain areas
NOTHING = np.full(SHAPE, np.nan, np.float32)
HERE = (30, 100)


def frame(
    disparity: float | np.ndarray = 20.0, gray: int | None = None, material: int = -1
) -> FrameTruth:
    """A surface before a camera that measures 1 to 4 m: disparities of 50 to 12.5 px."""
    rig = make_rig(*SHAPE[::-1], min_depth=1.0, max_depth=4.0, image_noise=3.0)
    image = broadband(SHAPE) // 2 + 64
    if gray is not None:
        image[20:40, 80:120] = gray
    truth = make_frame(disparity, rig, image)
    ids = np.full(SHAPE, material, np.int32)
    return replace(truth, material_ids=ids, materials=MATERIALS)


def step() -> np.ndarray:
    """The first column of the near half is 104: its edge is 3 px right of HERE."""
    return np.where(np.arange(160) < 104, 20.0, 20.0 + 1.5)[None].repeat(60, 0)


def shadow() -> np.ndarray:
    """Something near hides the columns 90 to 109 from the right eye."""
    disparity = np.full(SHAPE, 20.0)
    disparity[:, 110:140] = 40.0
    return disparity


@pytest.mark.parametrize(
    ("truth", "expected"),
    [
        (frame(), Cause.RANDOM),
        (frame(gray=WEAK), Cause.WEAK_TEXTURE),
        (frame(step()), Cause.EDGE),
        (frame(step(), WEAK), Cause.EDGE),
        (frame(step(), material=1), Cause.SPECULAR),
        (frame(gray=DARK, material=1), Cause.EXPOSURE),
        (frame(gray=253), Cause.EXPOSURE),
        (frame(gray=DARK, material=2), Cause.TRANSPARENT),
        (frame(gray=DARK, material=3), Cause.MIRROR),
        (frame(shadow(), DARK, material=3), Cause.OCCLUDED),
        (frame(101.0), Cause.NEAR),  # and without a partner in the right image
        (frame(45.0, material=3), Cause.MIRROR),
        (frame(12.0, material=3), Cause.FAR),
        (frame(np.nan), Cause.OK),
    ],
)
def test_the_strongest_claim_labels_a_missing_match(truth: FrameTruth, expected: Cause) -> None:
    assert attribute_errors(NOTHING, truth)[HERE] == expected


def test_columns_without_a_partner_are_the_band() -> None:
    labels = attribute_errors(NOTHING, frame(material=3))
    assert (labels[:, :20] == Cause.BAND).all() and (labels[:, 20:] == Cause.MIRROR).all()


def test_edges_reach_as_far_as_the_window() -> None:
    labels = attribute_errors(NOTHING, frame(step()))[30]
    assert np.flatnonzero(labels == Cause.EDGE).tolist() == [100, 101, 102, 104, 105, 106, 107]
    assert labels[103] == Cause.OCCLUDED


def test_what_is_off_by_no_more_than_a_pixel_is_right() -> None:
    truth = frame(gray=DARK)
    for off, expected in ((1.0, Cause.OK), (-1.0, Cause.OK), (1.01, Cause.EXPOSURE)):
        assert attribute_errors(truth.disparity + np.float32(off), truth)[HERE] == expected


@pytest.mark.parametrize("drift", [Drift(yaw_deg=0.3), Drift(baseline=0.1), Drift(pitch_deg=0.3)])
def test_a_drifted_calibration_is_blamed_for_its_columns_and_rows(drift: Drift) -> None:
    """A right match of what the pair shows; where only the rows are off, a missing one."""
    truth = replace(frame(), drift=drift)
    shown = drift.reported_disparity(truth.shown_disparity)
    found = NOTHING if drift.pitch_deg else shown
    assert attribute_errors(found, truth)[HERE] == Cause.RECTIFICATION
    assert attribute_errors(NOTHING, replace(truth, drift=Drift(yaw_deg=0.3)))[HERE] == Cause.RANDOM


def test_rays_are_asked_only_where_their_answer_counts() -> None:
    for truth, found in ((frame(shadow()), shadow()), (frame(0.3 * shadow()), NOTHING)):
        attribute_errors(found, truth)  # right, and out of range
        assert truth.rays.asked == []  # pyright: ignore[reportAttributeAccessIssue]
