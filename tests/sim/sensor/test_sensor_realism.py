"""The default sensor errs as matching over the full range does: where, how much, in which shapes, how long.

Both tiers see the same noisy images. `scripts/mutate_sensor.py` shows which test notices which fault.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.sim.fit.known_frame import WarpedRays
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.tiers import sense
from reference.error_shapes import (
    autocorrelation,
    failure_runs,
    small_error_rms,
)
from reference.recorded_scenes import RecordedScene, record_scene
from reference.stereo_pairs import bad_by_edge_distance
from studies.real_pair import load_motorcycle
from studies.realism_scenes import Scene, places
from studies.realism_scores import (
    agreement,
    bad_share,
    repeated_bad,
    small_hole_share,
    temporal_share,
)
from studies.stereo_scores import score

# Object and surround of the sample data: wood on a tiled floor, a painted cow in the woods.
SAMPLES = {"painted_stool": "st_fagans_interior", "spot": "forest_slope"}
DRAWS = 5  # of the image noise

TRUSTED = (0.0, 0.6, 0.8, 0.9, 0.95, 0.98, 1.0)  # ranges of confidence
FEW = 1000  # matches in such a range say little
FITTED_TO_OTHERS = ("sci_fi_case", "ycb_cracker_box")


@pytest.fixture(scope="module", params=["built-in", "drifted", *SAMPLES])
def scene(request: pytest.FixtureRequest) -> RecordedScene:
    name = request.param
    if name not in SAMPLES:
        return record_scene(drifts=name == "drifted")
    data: Path = request.getfixturevalue("sample_data")
    if not (data / "meshes" / name).is_dir():
        pytest.skip(f"no {name} in the sample data")
    (environment,) = (data / "envs" / SAMPLES[name]).glob("*.hdr")
    return record_scene(data / "meshes" / name / f"{name}.glb", environment)


@pytest.fixture(scope="module")
def pair(sample_data: Path) -> FrameTruth:
    folder = sample_data / "rgbd" / "middlebury_motorcycle"
    if not folder.is_dir():
        pytest.skip("no middlebury_motorcycle in the sample data")
    return load_motorcycle(folder)


def both(scene: RecordedScene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Disparity of the default sensor, of the full search, and the true one."""
    guided, matcher = (scene.sense(tier).disparity for tier in ("guided", "matcher"))
    return guided, matcher, scene.truth.disparity


def frames(scene: RecordedScene, tier) -> np.ndarray:
    """Disparity under several draws of the image noise, camera at rest."""
    return np.stack([scene.sense(tier, draw).disparity for draw in range(DRAWS)])


def test_failures_and_errors_lie_where_the_matchers_do(scene: RecordedScene) -> None:
    failures, rms = agreement(*both(scene))
    assert failures > 0.92 and rms > 0.95


def test_as_much_is_wrong_on_the_object_and_around_it(scene: RecordedScene) -> None:
    guided, matcher, true = both(scene)
    for part in (scene.mask, ~scene.mask):
        full = bad_share(matcher, true, part)
        assert bad_share(guided, true, part) == pytest.approx(full, rel=0.15)
        assert full > 0.01, "or there is nothing to compare"


def test_as_much_is_missing_and_the_rest_is_as_far_off(scene: RecordedScene) -> None:
    guided, matcher, true = both(scene)
    assert np.isfinite(guided).mean() == pytest.approx(np.isfinite(matcher).mean(), abs=0.008)
    full = small_error_rms(matcher, true)
    assert small_error_rms(guided, true) == pytest.approx(full, rel=0.03)


def test_hidden_pixels_and_edges_fail_as_often(scene: RecordedScene) -> None:
    guided, matcher, _ = both(scene)
    mine, full = score(guided, scene.truth), score(matcher, scene.truth)
    assert mine.occluded_holes == pytest.approx(full.occluded_holes, abs=0.03)
    assert mine.visible_holes == pytest.approx(full.visible_holes, abs=0.01)
    assert mine.edge_bad_1 == pytest.approx(full.edge_bad_1, rel=0.1)


@pytest.mark.parametrize("lag", [2, 4, 8, 16, 32])
def test_neighboring_errors_correlate_as_the_matchers(scene: RecordedScene, lag: int) -> None:
    guided, matcher, true = both(scene)
    for axis in (0, 1):
        mine, full = (autocorrelation(d, true, lag, axis) for d in (guided, matcher))
        assert mine == pytest.approx(full, abs=0.03)


def test_failures_are_strips_of_the_same_length(scene: RecordedScene) -> None:
    guided, matcher, true = both(scene)
    mine, full = failure_runs(guided, true), failure_runs(matcher, true)
    assert mine.mean() == pytest.approx(full.mean(), rel=0.15)
    # Weighted by length: the run that a failed pixel is in.
    assert (mine**2).sum() / mine.sum() == pytest.approx((full**2).sum() / full.sum(), rel=0.1)


def test_holes_are_as_large(scene: RecordedScene) -> None:
    """In the mean over the draws: a single one has few holes of a size."""
    guided, matcher = frames(scene, "guided"), frames(scene, "matcher")
    for size in (3, 10, 30):
        mine, full = (
            float(np.mean([small_hole_share(each, size) for each in tier]))
            for tier in (guided, matcher)
        )
        assert mine == pytest.approx(full, abs=0.004 + 0.3 * full)


def test_disparities_come_in_sixteenths_and_gather_at_whole_pixels(scene: RecordedScene) -> None:
    """Ripple: the parabola pulls toward whole pixels, as in the full search."""
    shares = []
    for disparity in both(scene)[:2]:
        found = disparity[np.isfinite(disparity)] / (1 + scene.truth.drift.baseline)
        sixteenths = np.rint(16 * found).astype(int)
        np.testing.assert_allclose(16 * found, sixteenths, atol=0.01)
        shares.append(np.bincount(sixteenths % 16, minlength=16) / len(sixteenths))
    assert np.abs(shares[0] - shares[1]).sum() / 2 < 0.025
    assert shares[1].max() > 2 / 16, "or there is no ripple"


def test_errors_stay_from_frame_to_frame_as_the_matchers(scene: RecordedScene) -> None:
    guided, matcher = frames(scene, "guided"), frames(scene, "matcher")
    true = scene.truth.disparity
    assert temporal_share(guided, true) == pytest.approx(temporal_share(matcher, true), abs=0.02)
    assert repeated_bad(guided, true) == pytest.approx(repeated_bad(matcher, true), abs=0.06)


def trust(scenes: Sequence[RecordedScene | Scene]) -> tuple[np.ndarray, np.ndarray]:
    """How many matches the default sensor has by confidence, and how much oftener than said are right."""
    confidence, right = [], []
    for scene in scenes:
        sensed, true = scene.sense("guided"), scene.truth.disparity
        known = sensed.known & np.isfinite(true)
        confidence.append(sensed.confidence[known])
        right.append((np.abs(sensed.disparity - true)[known] <= 1).astype(float))
    said = np.concatenate(confidence)
    counts, of_right, of_said = (
        np.histogram(said, TRUSTED, weights=weights)[0]
        for weights in (None, np.concatenate(right), said)
    )
    return counts, (of_right - of_said) / counts


def test_confidence_tells_how_often_a_match_is_right(sample_data: Path) -> None:
    """On scenes with a ground to which it was not fitted."""
    chosen = [p for p in places(sample_data) if p.mesh and p.mesh.stem in FITTED_TO_OTHERS]
    if len(chosen) < len(FITTED_TO_OTHERS):
        pytest.skip(f"no {' or '.join(FITTED_TO_OTHERS)} in the sample data")
    assert not any(place.tuned for place in chosen)
    counts, gaps = trust([place.scene(640) for place in chosen])
    assert np.average(np.abs(gaps), weights=counts) < 0.03
    assert np.average(gaps, weights=counts) > -0.015, "it states too little rather than too much"


def test_confidence_is_no_label(scene: RecordedScene) -> None:
    """It varies as continuously as what it is computed from, and right matches can have little of it."""
    sensed, true = scene.sense("guided"), scene.truth.disparity
    assert len(np.unique(sensed.confidence[sensed.known])) > 1000
    right = np.abs(sensed.disparity - true) <= 1
    wrong = sensed.known & np.isfinite(true) & ~right
    doubted = sensed.confidence < np.quantile(sensed.confidence[wrong], 0.5)
    assert (right & doubted).sum() > 0.3 * (wrong & doubted).sum()


def test_the_same_match_has_the_same_confidence_whatever_is_true(scene: RecordedScene) -> None:
    """With another truth in the same blocks of the search, right matches become wrong, and stay trusted."""
    truth = scene.truth
    moved = truth.disparity + np.float32(1.5)
    other = replace(truth, depth=np.float32(truth.rig.focal_baseline) / moved)
    first, second = scene.sense("guided"), sense(other, "guided", recorded=scene.images())
    same = first.disparity == second.disparity
    turned = same & (np.abs(first.disparity - truth.disparity) < 0.4)
    assert turned.sum() > 10_000
    change = np.abs(first.confidence - second.confidence)[turned]
    assert np.median(change) < 0.01 and np.quantile(change, 0.95) < 0.1


def test_the_images_have_the_noise_that_the_rig_states(scene: RecordedScene) -> None:
    for first, second in zip(scene.images(0), scene.images(1), strict=True):
        levels = first.astype(float), second.astype(float)
        middle_gray = np.abs((levels[0] + levels[1]) / 2 - 118) < 15  # where it is stated
        changes = (levels[0] - levels[1])[middle_gray]
        rounding = 1 / 12
        noise = np.sqrt(np.mean(changes**2) / 2 - rounding)
        assert noise == pytest.approx(scene.truth.rig.image_noise, rel=0.05)


def test_the_matcher_gives_the_published_figures_of_a_real_pair(pair: FrameTruth) -> None:
    """Fill 92 %, bad-1 8.4 % and 53 % of hidden pixels lost for window 5 in the reference measurement."""
    scores = score(sense(pair, "matcher").disparity, pair)  # the images have real noise already
    assert scores.fill == pytest.approx(0.917, abs=0.02)
    assert scores.bad_1 == pytest.approx(0.084, abs=0.01)
    assert scores.occluded_holes == pytest.approx(0.53, abs=0.06)
    assert scores.occluded_bad_1 == pytest.approx(0.9, abs=0.06)


def test_on_a_real_pair_it_errs_where_and_as_the_matcher_does(pair: FrameTruth) -> None:
    guided, matcher, true = (
        *(sense(pair, t).disparity for t in ("guided", "matcher")),
        pair.disparity,
    )
    assert min(agreement(guided, matcher, true)) > 0.96
    everywhere = np.ones(true.shape, bool)
    full = bad_share(matcher, true, everywhere)
    assert bad_share(guided, true, everywhere) == pytest.approx(full, rel=0.05)
    assert small_error_rms(guided, true) == pytest.approx(small_error_rms(matcher, true), rel=0.02)
    assert np.isfinite(guided).mean() == pytest.approx(np.isfinite(matcher).mean(), abs=0.005)
    # From the depth steps outward.
    zones, full_zones = (bad_by_edge_distance(d, pair) for d in (guided, matcher))
    np.testing.assert_allclose(zones, full_zones, atol=0.015)
    assert full_zones[0] > 8 * max(full_zones[3:])


def test_the_rays_of_a_disparity_image_find_what_a_box_hides() -> None:
    disparity = np.full((20, 100), 5.0)
    disparity[:, 50:70] = 17.0
    visible = WarpedRays(disparity).right_visibility()
    hidden = np.flatnonzero(~visible[10])
    assert abs(len(hidden) - 12) <= 2 and hidden.max() == 49
    asked = np.zeros_like(visible)
    asked[:10] = True
    assert (WarpedRays(disparity).right_visibility(asked) == (visible | ~asked)).all()
