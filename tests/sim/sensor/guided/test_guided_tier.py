"""The guided tier on frames: where it fails, what it says about itself, and that it repeats itself."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import spearmanr

from digs_warp.checks import DigsError
from digs_warp.sim.camera.shutter import Shutter
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.sensor_plan import SensorPlan, check_effects, plan_for_facts
from digs_warp.sim.record.session import prepare_session
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.effects import EFFECTS
from digs_warp.sim.sensor.facts import measure_facts
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.guided.tier import sense_by_guided_matching
from digs_warp.sim.sensor.tiers import Tier, sense
from studies.stereo_scores import score

BLOCK = 20  # pixels; failures are compared per block


@pytest.fixture(scope="module")
def frame() -> tuple[FrameTruth, SensorPlan, tuple[np.ndarray, np.ndarray]]:
    """The built-in object in its room, the plan, and the images that would be recorded."""
    config = SimulateConfig(profile="bare-matcher", width=480, frames=7, seed=2, tier="guided")
    session = prepare_session(config, load_inputs(config))
    truth, _ = session.truth(3, Shutter())
    plan = plan_for_facts(measure_facts([truth], truth.rig), session.rig, config)
    return truth, plan, recorded_images(truth, plan.pixel_effects)


def per_block(disparity: np.ndarray, truth: FrameTruth) -> tuple[np.ndarray, np.ndarray]:
    """Share of failed pixels, and RMS error of the others, of each block that has both."""
    error = np.abs(disparity - truth.disparity)
    inside = truth.disparity <= np.arange(error.shape[1]) + 0.5
    failed = np.where(np.isfinite(truth.disparity) & inside, ~(error <= 1), np.nan)
    square = np.where(error <= 1, error**2, np.nan)
    rows, columns = (n // BLOCK for n in error.shape)

    def blocks(values: np.ndarray) -> np.ndarray:
        cut = values[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK)
        with np.errstate(invalid="ignore"):
            count = np.isfinite(cut).sum(axis=(1, 3))
            return (np.nansum(cut, axis=(1, 3)) / np.where(count > 20, count, np.nan)).ravel()

    return blocks(failed), blocks(square)


def test_it_fails_and_errs_where_the_full_search_does(
    frame: tuple[FrameTruth, SensorPlan, tuple[np.ndarray, np.ndarray]],
) -> None:
    truth, _, recorded = frame
    matched = sense(truth, "matcher", recorded=recorded).disparity
    guided = sense(truth, "guided", recorded=recorded).disparity
    for mine, full in zip(per_block(guided, truth), per_block(matched, truth), strict=True):
        both = np.isfinite(mine) & np.isfinite(full)
        assert spearmanr(mine[both], full[both])[0] > 0.9  # pyright: ignore[reportOperatorIssue]
    real, model = score(matched, truth), score(guided, truth)
    assert model.bad_1 == pytest.approx(real.bad_1, rel=0.25)
    assert model.fill == pytest.approx(real.fill, abs=0.03)
    assert model.rms == pytest.approx(real.rms, rel=0.1)
    assert real.bad_1 > 0.01 and real.fill < 0.97, "or there is nothing to compare"


def test_a_bad_pixel_stays_bad_under_other_noise(
    frame: tuple[FrameTruth, SensorPlan, tuple[np.ndarray, np.ndarray]],
) -> None:
    """What texture and edges cause does not change with the noise of the next frame."""
    truth, plan, _ = frame
    bad = []
    for seed in (1, 2):
        recorded = recorded_images(truth, plan.pixel_effects, seed)
        found = sense_by_guided_matching(truth, recorded).disparity
        bad.append(np.abs(found - truth.disparity) > 1)
    assert (bad[0] & bad[1]).sum() > 0.3 * bad[0].sum()


@pytest.mark.parametrize("tier", ["guided", "matcher"])
def test_confidence_is_the_share_of_good_matches(
    frame: tuple[FrameTruth, SensorPlan, tuple[np.ndarray, np.ndarray]], tier: Tier
) -> None:
    truth, _, recorded = frame
    sensed = sense(truth, tier, recorded=recorded)
    good = np.abs(sensed.disparity - truth.disparity) <= 1
    shares, gaps, counts = [], [], []
    for low, high in ((0, 0.6), (0.6, 0.8), (0.8, 0.95), (0.95, 1.01)):
        there = sensed.known & (sensed.confidence >= low) & (sensed.confidence < high)
        shares.append(good[there].mean())
        gaps.append(abs(shares[-1] - sensed.confidence[there].mean()))
        counts.append(there.sum())
    assert (np.diff(shares) > 0).all() and shares[0] < 0.7
    assert np.average(gaps, weights=counts) < 0.05
    assert (sensed.confidence[~sensed.known] == 0).all()


def test_confidence_knows_nothing_of_the_truth(
    frame: tuple[FrameTruth, SensorPlan, tuple[np.ndarray, np.ndarray]],
) -> None:
    """A truth within the same blocks gives the same match and so the same confidence, right or wrong."""
    truth, _, recorded = frame
    nudged = replace(truth, depth=truth.depth * np.float32(1.0001))
    first, second = (sense_by_guided_matching(t, recorded) for t in (truth, nudged))
    same = first.disparity == second.disparity
    assert same.mean() > 0.5
    close = np.abs(first.confidence - second.confidence)[same] < 1e-3
    assert close.mean() > 0.98


def test_the_plan_adds_second_surfaces_and_what_no_image_shows(
    frame: tuple[FrameTruth, SensorPlan, tuple[np.ndarray, np.ndarray]],
) -> None:
    truth, plan, recorded = frame
    assert {choice.effect for choice in plan.depth} == {effect.name for effect in EFFECTS}
    assert "static-field" in {c.effect for c in plan.depth if c.on}
    plain = sense(truth, "guided", recorded=recorded)
    full = sense(truth, "guided", plan.depth, recorded=recorded)
    added = (full.disparity - plain.disparity)[plain.known & full.known]
    assert 0.03 < np.median(np.abs(added)) < 0.2


def test_a_full_search_refuses_second_surfaces_by_name() -> None:
    with pytest.raises(DigsError, match=r"--effects mirror: the tier 'matcher' searches the full"):
        check_effects(SimulateConfig(tier="matcher", effects="mirror,static-field"))
    for effects in ("all", "none", "vignetting,static-field"):
        for tier in ("guided", "matcher"):
            check_effects(SimulateConfig(tier=tier, effects=effects))
