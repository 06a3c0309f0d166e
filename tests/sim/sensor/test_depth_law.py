"""Depth beside that of real devices: noise, step, range, holes, by the law and of simulated scenes."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.fit.device_figures import WINDOWS, Holes, holes, roughness, temporal_share
from digs_warp.sim.record.record import simulate_in_memory
from digs_warp.sim.sensor.frame import Cause, Sensed
from digs_warp.sim.sensor.law import sense_depth, with_holes
from studies.device import BOARDS, EDGES, board_figures, edge_figures

WHITE = {"disparity_correlation": 0.0, "temporal_share": 1.0}
RIG = replace(load_profile("bare-matcher").rig(320, 200), **WHITE)
FOCAL_BASELINE = RIG.intrinsics.fx * RIG.baseline


def plane(depth: float) -> np.ndarray:
    return np.full((200, 320), depth, dtype=np.float32)


def ideal(**changes: float) -> StereoRig:
    return replace(RIG, **{"disparity_sigma": 0.0, "disparity_step": 0.0, **changes})


@pytest.mark.parametrize(("depth", "strength"), [(0.5, 1.0), (1.0, 0.5), (3.0, 2.0)])
def test_disparity_residual_has_the_sigma_of_the_rig(depth: float, strength: float) -> None:
    # A slanted plane, so that rounding errors spread evenly over the step.
    true = plane(depth) * np.linspace(1.0, 1.1, 320, dtype=np.float32)
    error = FOCAL_BASELINE / sense_depth(true, RIG, 1, 0, strength) - FOCAL_BASELINE / true
    expected = strength * np.hypot(RIG.disparity_sigma, RIG.disparity_step / np.sqrt(12))
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


def wall_of(name: str, depth: float, frames: int, seed: int = 0) -> tuple[StereoRig, np.ndarray]:
    """The rig of a profile, and frames of disparity [px] of a wall across the view."""
    rig = load_profile(name).rig()
    true = np.full((rig.intrinsics.height, rig.intrinsics.width), depth, np.float32)
    return rig, np.stack(
        [rig.focal_baseline / sense_depth(true, rig, seed, i) for i in range(frames)]
    )


# Of real devices, in windows of 8 to 64 px [px]: a D435 (d435_planes of the sample data), and a D455 before a
# flat board.
@pytest.mark.parametrize(
    ("name", "real"),
    [("d435", [0.020, 0.033, 0.071, 0.106]), ("d455", [0.031, 0.068, 0.113, 0.124])],
)
def test_walls_are_as_rough_in_windows_of_any_size_as_the_devices(
    name: str, real: list[float]
) -> None:
    _, disparity = wall_of(name, 1.2, 2)
    rough = [roughness(disparity, size).median() for size in WINDOWS]
    np.testing.assert_array_less(np.abs(np.log(np.array(rough) / real)), np.log(1.3))


# Of an Orbbec Gemini 33x before a white board: deviation of a pixel, and of a frame from its plane [mm].
@pytest.mark.parametrize(
    ("depth", "temporal", "rmse"),
    [
        (0.5, 0.44, 1.26),
        (1.0, 1.47, 3.69),
        (1.5, 2.77, 5.06),
        (2.0, 4.66, 9.07),
        (3.0, 11.55, 16.92),
    ],
)
def test_noise_of_the_gemini_changes_and_grows_as_the_devices(
    depth: float, temporal: float, rmse: float
) -> None:
    rig, disparity = wall_of("gemini-335", depth, 6)
    error = disparity - rig.focal_baseline / depth
    in_mm = 1000 * depth**2 / rig.focal_baseline
    assert in_mm * np.sqrt(np.mean(error**2)) == pytest.approx(rmse, rel=0.2)
    assert temporal_share(error) == pytest.approx((temporal / rmse) ** 2, abs=0.1)


def with_holes_of(depth: np.ndarray, rig: StereoRig, frame: int = 0) -> Sensed:
    true = np.float32(rig.focal_baseline) / depth
    plain = Sensed(true, np.zeros(true.shape, np.uint8), np.ones(true.shape, np.float32))
    return with_holes(plain, true, rig, 0, frame)


def test_holes_have_the_number_and_the_sizes_of_the_devices() -> None:
    rig = load_profile("d435").rig()
    depth = np.full((480, 848), 1.2, np.float32)
    first, second = (with_holes_of(depth, rig, frame) for frame in (0, 1))
    found = holes(first.disparity)
    assert found.share == pytest.approx(rig.hole_share, rel=0.2)
    assert found.per_10000 == pytest.approx(10.5, rel=0.5)
    assert found.small == pytest.approx(0.020, rel=0.5)
    again = np.isnan(first.disparity) & np.isnan(second.disparity)
    assert 0.4 < again.sum() / np.isnan(first.disparity).sum() < 0.9
    assert set(np.unique(first.cause)) == {Cause.OK, Cause.RANDOM}


def test_near_things_throw_a_shadow_to_their_left() -> None:
    rig = load_profile("d435").rig()
    depth = np.full((480, 848), 2.0, np.float32)
    depth[100:300, 400:500] = 0.5
    shadow = with_holes_of(depth, rig).cause == Cause.OCCLUDED
    wide = rig.focal_baseline * (1 / 0.5 - 1 / 2.0)
    assert shadow[100:300, 400 - int(wide) + 2 : 398].mean() > 0.9
    shadow[100:300, 400 - int(wide) - 2 : 402] = False
    assert not shadow.any()


# Of d435_planes of the sample data: residuals to a plane at 1.2 m in windows of 8 to 64 px [px], and holes.
REAL: dict[int, float] = dict(zip(WINDOWS, (0.020, 0.033, 0.071, 0.106), strict=True))
REAL_HOLES = Holes(share=0.067, per_10000=10.5, small=0.020)


@cache
def disparity() -> np.ndarray:
    """Two frames of the built-in room in disparity of the depth camera [px], NaN where there is none."""
    config = SimulateConfig(profile="d435", width=848, frames=2, samples_per_pixel=1)
    capture = simulate_in_memory(config)
    depth = np.stack([frame.load_depth() for frame in capture.frames])
    return 424.0 * 0.05 / np.where(np.isfinite(depth), depth, np.nan)


@pytest.mark.parametrize("size", WINDOWS[:3])
def test_planes_are_as_rough_as_the_devices(size: int) -> None:
    at_distance = roughness(disparity(), size).median(424 * 0.05 / 1.4, 424 * 0.05 / 1.0)
    assert abs(np.log(at_distance / REAL[size])) < np.log(1.4)


def test_holes_are_as_many_and_as_small_as_the_devices() -> None:
    found = [holes(frame) for frame in disparity()]
    for name, real in vars(REAL_HOLES).items():
        mean = np.mean([getattr(each, name) for each in found])
        assert abs(np.log(mean / real)) < np.log(1.6), name


@pytest.mark.parametrize("distance", [1.0, 3.0])
def test_boards_before_the_gemini_are_as_rough_and_change_as_published(distance: float) -> None:
    _, _, temporal, rmse = BOARDS[distance]
    found = board_figures(distance, tiers=("guided",))
    assert found["guided: RMSE [mm]"] == pytest.approx(rmse, rel=0.2)
    assert found["guided: share that changes"] == pytest.approx((temporal / rmse) ** 2, abs=0.1)


def test_depth_steps_before_the_gemini_are_as_sharp_as_published() -> None:
    """Of a board at 2 m, 30 cm before another: 18 % of the values within 12 px lie between the two."""
    _, width, mixed, _ = EDGES[2.0]
    found = edge_figures(2.0)
    assert found["guided: width [px]"] == pytest.approx(width, rel=0.5)
    assert found["guided: mixed"] == pytest.approx(mixed, rel=0.5)
