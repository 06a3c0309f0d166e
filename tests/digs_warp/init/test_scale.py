"""The mode of the local scales: precision, robustness, warnings."""

import logging
from dataclasses import replace

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.init.config import InitConfig
from digs_warp.init.scale import estimate_scale, local_scales
from reference.synthetic_sfm import sfm_from_truth

TRUE = 1.7


def noisy(count: int, deviation: float, outliers: float = 0.0, seed: int = 0) -> np.ndarray:
    """A normal peak at TRUE with a relative ``deviation``; a share of outliers anywhere up to 8."""
    rng = np.random.default_rng(seed)
    peak = TRUE * (1 + deviation * rng.normal(size=round(count * (1 - outliers))))
    return rng.permutation(np.append(peak, rng.uniform(0.05, 8.0, count - len(peak))))


# sigma_ij of stereo spreads by about 0.5 % at the object and 3 % at a surround of 4 m.
@pytest.mark.parametrize(("deviation", "outliers"), [(0.002, 0.9), (0.03, 0.3)])
def test_a_million_values_tell_the_mode_to_a_thousandth(deviation: float, outliers: float) -> None:
    found = estimate_scale(noisy(1_000_000, deviation, outliers))
    assert found.sfm_per_metre == pytest.approx(TRUE, rel=1e-3)
    assert found.width == pytest.approx(TRUE * deviation, rel=0.25)
    assert found.values == 1_000_000


def test_few_values_give_one_of_their_range_and_the_unit_does_not_matter() -> None:
    for values in (
        *(noisy(count, 0.02, seed=count) for count in (1, 2, 5, 50)),
        np.full(5000, 0.3),
    ):
        scale = estimate_scale(values).sfm_per_metre
        assert values.min() - 0.02 <= scale <= values.max() + 0.02
        for unit in (1e-6, 1e6):
            other = estimate_scale(values * unit).sfm_per_metre
            assert other == pytest.approx(scale * unit, rel=1e-4)


def test_junk_does_not_count_and_nothing_else_raises() -> None:
    values, junk = noisy(1000, 0.01), [np.nan, np.inf, -np.inf, 0.0, -1.0]
    assert estimate_scale(np.append(values, junk * 1000)) == estimate_scale(values)
    for unusable in ([], junk):
        with pytest.raises(DigsError, match=f"scale: {len(unusable)} points .*--poses capture"):
            estimate_scale(np.array(unusable))


def test_two_modes_as_high_as_each_other_are_told(caplog) -> None:
    # Half of the frames in feet: both peaks have the same height when their values do not scale along.
    peak = noisy(20_000, 0.01)
    values = np.append(peak, peak + 2.0)
    with caplog.at_level(logging.WARNING):
        found = estimate_scale(values)
    assert min(abs(found.sfm_per_metre - mode) for mode in (TRUE, TRUE + 2.0)) < 0.005
    assert "a second mode at" in caplog.text


def test_wild_values_and_their_order_do_not_matter() -> None:
    values = noisy(5000, 0.01, 0.2)
    before = values.copy()
    wild = estimate_scale(np.append(values, [1e6, 1e9, 1e-9]))
    assert wild.sfm_per_metre == pytest.approx(TRUE, rel=5e-3)
    assert estimate_scale(values[::-1].reshape(50, 100)) == estimate_scale(values)
    np.testing.assert_array_equal(values, before)


def test_measured_depth_scales_a_model(ball_ring: Capture, caplog) -> None:
    frames = ball_ring.frames
    model = sfm_from_truth(frames, TRUE, points=4000)
    config = InitConfig(edge_filter=False)
    ratios = local_scales(model, frames[2:], config)
    assert estimate_scale(ratios).sfm_per_metre == pytest.approx(TRUE, rel=2e-3)
    assert "inside the masks" not in caplog.text
    few = local_scales(sfm_from_truth(frames, TRUE, points=60), frames, config)
    assert "inside the masks" in caplog.text  # the whole image counts
    assert estimate_scale(few).sfm_per_metre == pytest.approx(TRUE, rel=5e-3)
    strangers = [replace(frame, name="x" + frame.name) for frame in frames]
    with pytest.raises(DigsError, match="registered none of the 12 training frames"):
        local_scales(model, strangers, config)
