"""Semi-global matching of pairs with known disparity, and the labels of what it misses."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.sim.sensor.color.image_noise import ReadNoise, ShotNoise
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.filters import gray_of
from digs_warp.sim.sensor.frame import Cause
from digs_warp.sim.sensor.guided.confidence import confidence_of
from digs_warp.sim.sensor.matcher import search_range
from digs_warp.sim.sensor.tiers import sense, sense_by_matching
from reference.stereo_frames import broadband, flat, make_frame, make_rig
from reference.stereo_pairs import (
    box_frame,
    plane_pair,
    shifted_right_eye,
)
from studies.stereo_scores import score


@pytest.mark.parametrize("disparity", [7.0, 20.25, 40.5, 100.75])
def test_planes_are_matched_up_to_the_band_whatever_their_depth(disparity: float) -> None:
    """OpenCV alone gives up as many columns as it searches; here only those without a partner are lost."""
    truth = plane_pair(disparity)
    found = sense(truth, "matcher").disparity
    inside = found[:, int(np.ceil(disparity)) + 8 :]
    assert np.isfinite(inside).mean() > 0.98
    error = inside - disparity
    assert (np.abs(error[np.isfinite(error)]) < 1).mean() > 0.995
    # Pixel locking pulls fractional disparities by up to 0.2 px.
    assert np.sqrt(np.nanmean(np.clip(error, -1, 1) ** 2)) < 0.25
    assert np.isfinite(found[:, : int(disparity) - 3]).mean() < 0.1


def test_the_search_covers_the_nearest_depth_but_not_more_than_the_image() -> None:
    assert search_range(make_rig(640, 480, min_depth=0.5)) == 112  # 50 / 0.5 = 100 px
    assert search_range(make_rig(640, 480, min_depth=0.01)) == 640
    assert search_range(make_rig(640, 480, max_disparity=95.0)) == 96


def test_occlusion_is_left_of_near_things_and_labeled() -> None:
    """A textured box before a textured wall: the matcher loses or mistakes what the box hides."""
    truth, (rows, columns) = box_frame(38.0, 8.0)
    left = truth.image
    right = shifted_right_eye(left, 8.0)
    # The right eye sees another part of the wall where the left one sees the box.
    right[rows, columns.start - 8 : columns.stop - 8] = broadband(left.shape[:2], 9)[rows, columns]
    moved = slice(columns.start - 38, columns.stop - 38)
    right[rows, moved] = left[rows, columns]
    sensed = sense_by_matching(replace(truth, right=right))
    hidden = slice(columns.start - 30, columns.start)
    failed = ~(np.abs(sensed.disparity - truth.disparity) <= 1)
    assert failed[rows, hidden].mean() > 0.85
    assert failed[rows, columns].mean() < 0.1
    labels = sensed.cause[rows, hidden]
    assert (labels[failed[rows, hidden]] == Cause.OCCLUDED).all()
    assert (labels[~failed[rows, hidden]] == Cause.OK).all()


def test_confidence_is_high_on_texture_and_lower_without() -> None:
    """It knows nothing of the truth: the same images with another truth have the same confidence."""
    texture, gray = broadband((120, 320), 4), flat((120, 320))
    image = np.concatenate([texture, gray])
    truth = make_frame(20.0, image=image)
    pair = replace(truth, right=shifted_right_eye(image, 20.0))
    recorded = recorded_images(pair, (ShotNoise(), ReadNoise()), seed=2)
    sensed = sense_by_matching(truth, recorded)
    known = sensed.known
    assert (sensed.confidence[~known] == 0).all() and sensed.confidence.max() <= 1
    top, bottom = (sensed.confidence[rows, 40:] for rows in (slice(10, 110), slice(130, 230)))
    assert np.median(top) > 0.9
    assert bottom[known[130:230, 40:]].mean() < 0.75
    wrong = sense_by_matching(make_frame(33.0, image=image), recorded)
    np.testing.assert_array_equal(wrong.confidence, sensed.confidence)
    ones = np.ones((120, 320), np.int16)
    assert not confidence_of(gray_of(gray), 20 * ones, 0 * ones, ones).any()


def test_scores_count_what_they_say() -> None:
    truth, (rows, columns) = box_frame(38.0, 8.0)
    perfect = score(truth.disparity, truth)
    assert (perfect.fill, perfect.bad_1, perfect.rms, perfect.occluded_holes) == (1, 0, 0, 0)
    spoiled = truth.disparity.copy()
    spoiled[:60] += 5  # a quarter of the rows, above the box
    spoiled[60:] += 0.25
    spoiled[rows, columns.start - 30 : columns.start - 15] = np.nan
    scores = score(spoiled, truth)
    lost = 15 * (rows.stop - rows.start) / spoiled.size
    assert scores.fill == pytest.approx(1 - lost)
    assert scores.bad_1 == pytest.approx(0.25 / (1 - lost))
    assert scores.rms == pytest.approx(0.25, abs=1e-6)
    assert scores.occluded_holes == pytest.approx(0.5)
    assert scores.occluded_bad_1 == 0 and scores.visible_holes == 0
