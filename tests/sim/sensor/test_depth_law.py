"""The law tier: noise, step and range of a stereo pair, against the closed form."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.law import sense_depth
from reference.zed2 import zed2_like

RIG = zed2_like(320, 200)
FOCAL_BASELINE = RIG.intrinsics.fx * RIG.baseline


def plane(depth: float) -> np.ndarray:
    return np.full((200, 320), depth, dtype=np.float32)


def ideal(**changes: float) -> StereoRig:
    return replace(RIG, **{"disparity_sigma": 0.0, "disparity_step": 0.0, **changes})


def test_depth_noise_grows_with_the_square_of_depth() -> None:
    depths = np.array([0.6, 1.0, 1.5, 2.5, 4.0])
    sigmas = [sense_depth(plane(z), RIG, 0, i).std() for i, z in enumerate(depths)]
    slope = np.polyfit(np.log(depths), np.log(sigmas), 1)[0]
    assert slope == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("depth", [0.5, 1.0, 3.0])
def test_disparity_residual_has_the_sigma_of_the_rig(depth: float) -> None:
    # A slanted plane, so that rounding errors spread evenly over the step.
    true = plane(depth) * np.linspace(1.0, 1.1, 320, dtype=np.float32)
    error = FOCAL_BASELINE / sense_depth(true, RIG, 1, 0) - FOCAL_BASELINE / true
    expected = np.hypot(RIG.disparity_sigma, RIG.disparity_step / np.sqrt(12))
    assert error.std() == pytest.approx(expected, rel=0.05)
    assert abs(error.mean()) < 5 * expected / np.sqrt(error.size)


def test_disparity_comes_in_steps() -> None:
    disparity = FOCAL_BASELINE / sense_depth(plane(1.0), RIG, 0, 0).astype(np.float64)
    steps = disparity * 16
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-4)
    assert len(np.unique(np.round(steps))) > 5


def test_without_noise_and_step_the_truth_comes_back_bit_for_bit() -> None:
    true = np.random.default_rng(0).uniform(0.31, 19.9, (200, 320)).astype(np.float32)
    np.testing.assert_array_equal(sense_depth(true, ideal(), 0, 0), true)


def test_noise_belongs_to_seed_and_frame() -> None:
    sensed = {key: sense_depth(plane(1.0), RIG, *key) for key in [(0, 0), (0, 1), (1, 0)]}
    np.testing.assert_array_equal(sense_depth(plane(1.0), RIG, 0, 0), sensed[0, 0])
    assert not np.array_equal(sensed[0, 0], sensed[0, 1])
    assert not np.array_equal(sensed[0, 0], sensed[1, 0])


def test_default_rig_has_the_figures_of_a_zed2_in_proportion() -> None:
    small, large = zed2_like(640, 360), zed2_like(1280, 720)
    assert large.intrinsics.fx == pytest.approx(2 * small.intrinsics.fx)
    assert small.intrinsics.fx == pytest.approx(320 / np.tan(np.deg2rad(30)))
    assert (small.baseline, small.min_depth, small.max_depth) == (0.12, 0.3, 20.0)


@pytest.mark.parametrize(
    "changes",
    [{"baseline": 0.0}, {"disparity_sigma": -1.0}, {"disparity_step": np.nan}, {"min_depth": 30.0}],
)
def test_impossible_rigs_are_refused(changes: dict[str, float]) -> None:
    with pytest.raises(DigsError, match="rig"):
        replace(RIG, **changes)


def test_depth_of_another_size_is_refused() -> None:
    with pytest.raises(DigsError, match=r"shape \(3, 3\)"):
        sense_depth(np.ones((3, 3), np.float32), RIG, 0, 0)
