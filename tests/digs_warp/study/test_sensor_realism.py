"""The planned tier against real matching of a real pair with true disparity (Middlebury Motorcycle)."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.study.real_pair import WarpedRays, load_motorcycle
from sim.sensor.blame import near_steps
from sim.sensor.facts import measure_facts
from sim.sensor.frame import FrameTruth
from sim.sensor.matcher import sense_by_matching
from sim.sensor.planner import plan
from sim.sensor.scores import bad_by_edge_distance, score
from sim.sensor.tiers import sense


@pytest.fixture(scope="module")
def pair(sample_data: Path) -> FrameTruth:
    return load_motorcycle(sample_data / "rgbd" / "middlebury_motorcycle")


@pytest.fixture(scope="module")
def matched(pair: FrameTruth) -> np.ndarray:
    return sense_by_matching(pair).disparity  # the images have real noise already


@pytest.fixture(scope="module")
def planned(pair: FrameTruth) -> np.ndarray:
    return sense(pair, "planned", plan(measure_facts([pair]), pair.rig)).disparity


def test_the_matcher_gives_the_published_figures(pair: FrameTruth, matched: np.ndarray) -> None:
    """Fill 92 %, bad-1 8.4 % and 53 % of hidden pixels lost for window 5 in the reference measurement."""
    scores = score(matched, pair)
    assert scores.fill == pytest.approx(0.917, abs=0.02)
    assert scores.bad_1 == pytest.approx(0.084, abs=0.01)
    assert scores.occluded_holes == pytest.approx(0.53, abs=0.06)
    assert scores.occluded_bad_1 == pytest.approx(0.9, abs=0.06)


def test_the_planned_tier_fills_like_the_matcher(
    pair: FrameTruth, matched: np.ndarray, planned: np.ndarray
) -> None:
    real, model = score(matched, pair), score(planned, pair)
    assert model.fill == pytest.approx(real.fill, abs=0.03)
    assert model.visible_holes == pytest.approx(real.visible_holes, abs=0.03)


def test_hidden_pixels_become_holes_or_wrong_like_the_matchers(
    pair: FrameTruth, matched: np.ndarray, planned: np.ndarray
) -> None:
    real, model = score(matched, pair), score(planned, pair)
    assert model.occluded_holes == pytest.approx(real.occluded_holes, abs=0.12)
    assert model.occluded_bad_1 == pytest.approx(real.occluded_bad_1, abs=0.17)


def test_errors_gather_at_the_steps_for_both(
    pair: FrameTruth, matched: np.ndarray, planned: np.ndarray
) -> None:
    for disparity in (matched, planned):
        zones = bad_by_edge_distance(disparity, pair)
        assert (np.diff(zones[:4]) < 0).all()
        assert zones[0] > 8 * max(zones[3:])
        # 72 to 74 % of the bad pixels near edges read too near in the reference measurement.
        error = (disparity - pair.disparity)[near_steps(pair.disparity, 5)]
        assert (error[np.abs(error) > 1] > 0).mean() > 0.6


def test_the_rays_of_a_disparity_image_find_what_a_box_hides() -> None:
    disparity = np.full((20, 100), 5.0)
    disparity[:, 50:70] = 17.0
    visible = WarpedRays(disparity).right_visibility()
    hidden = np.flatnonzero(~visible[10])
    assert abs(len(hidden) - 12) <= 2 and hidden.max() == 49
    asked = np.zeros_like(visible)
    asked[:10] = True
    assert (WarpedRays(disparity).right_visibility(asked) == (visible | ~asked)).all()
