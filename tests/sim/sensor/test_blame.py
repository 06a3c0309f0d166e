"""Labels of failed matches, and what the right eye cannot see, with as few rays as possible."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.drift import Drift
from digs_warp.sim.sensor.error_attribution import attribute_errors
from digs_warp.sim.sensor.frame import Cause, FrameTruth
from digs_warp.sim.sensor.right_eye import HIDDEN, SEEN, UNSURE
from digs_warp.sim.sensor.right_eye import classify as classify_some
from reference.right_eye_twin import classified
from reference.stereo_frames import PLAIN, CountedRays, broadband, make_frame, make_rig

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


LARGE = (240, 320)


def classify(disparity: np.ndarray, opaque: np.ndarray) -> np.ndarray:
    """The classes of all pixels."""
    return classify_some(disparity, opaque, np.ones(disparity.shape, bool))


@dataclass
class NoRays(CountedRays):
    """Remembers for which pixels rays were asked; they all see their point."""

    count: int = 0

    def right_visibility(
        self, where: np.ndarray | None = None, depth: np.ndarray | None = None
    ) -> np.ndarray:
        assert where is not None
        self.count += int(np.count_nonzero(where))
        return np.ones(self.shape, dtype=bool)


def square(near: float = 40.0, far: float = 10.0) -> np.ndarray:
    disparity = np.full(LARGE, far)
    disparity[80:160, 100:220] = near
    return disparity


def test_the_strip_left_of_a_near_square_is_hidden_without_rays() -> None:
    truth = replace(make_frame(square()), rays=NoRays(LARGE))
    hidden = truth.hidden
    assert (hidden.sum(axis=1)[80:160] >= 30 - 3).all() and (hidden.sum(axis=1) <= 30).all()
    assert hidden[80:160, 72:98].all() and not hidden[:80].any()
    assert isinstance(truth.rays, NoRays) and truth.rays.count < 4 * 80


def test_what_stands_behind_glass_is_not_hidden_for_sure() -> None:
    truth = make_frame(square())
    ids = (square() > 20).astype(np.int32)
    glass = Material("glass", np.ones(3), transmission=1.0)
    truth = replace(
        truth, material_ids=ids, materials=(*truth.materials, glass), rays=NoRays(LARGE)
    )
    assert not truth.hidden.any()


def test_long_rows_are_classified_as_point_by_point() -> None:
    """Most of these rows is passed over block by block; a ball, a thin rod and a far wall behind them."""
    columns, rows = np.meshgrid(np.arange(300.0), np.arange(24.0))
    disparity = np.round((8 + 0.01 * columns + 0.02 * rows) * 64) / 64
    ball = np.hypot(columns - 210, 4 * (rows - 12)) < 50
    disparity[ball] = 31.25
    disparity[:, 130:133] = 17.5
    disparity[:, 40:60] = np.round((12 + 0.7 * np.arange(20)) * 64) / 64  # flat rising slope
    disparity[20:, 280:] = np.nan
    disparity[:4, :40] = (
        np.round((np.arange(40) + 0.05 * rows[:4, :40] - 0.3) * 64) / 64
    )  # the left border
    opaque = disparity.copy()
    opaque[5:9, 180:200] = np.nan
    expected = classified(disparity, opaque)
    np.testing.assert_array_equal(classify(disparity, opaque), expected)
    assert {HIDDEN, UNSURE, SEEN} == set(expected.ravel().tolist())


@pytest.mark.parametrize("width", [1, 15, 16, 90, 300])
def test_pixels_that_nobody_asks_for_count_as_seen_and_change_nothing(width: int) -> None:
    rng = np.random.default_rng(width)
    disparity = (rng.integers(0, 64 * 12, (40, width)) / 64).astype(np.float32)
    disparity[10:30, width // 4 : width // 2] = 20.25
    where = rng.random(disparity.shape) < 0.3
    some = classify_some(disparity, disparity, where)
    np.testing.assert_array_equal(some, np.where(where, classify(disparity, disparity), SEEN))
