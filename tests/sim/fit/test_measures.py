"""Each statistic of a wall and of a device against arrays whose figures are known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from digs_warp.geometry.camera import Intrinsics
from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.fit.calibration import bias, fit_line
from digs_warp.sim.fit.device_figures import (
    WINDOWS,
    correlation_of,
    holes,
    roughness,
    temporal_share,
)
from digs_warp.sim.fit.estimate import Estimate, block_numbers, block_sums, jackknife, ratio
from digs_warp.sim.fit.image_noise import image_noise
from digs_warp.sim.fit.plane import fit_plane
from digs_warp.sim.fit.wall import Wall, make_pose
from digs_warp.sim.fit.wall_figures import depth_range, disparity_step, noise, wall_holes
from digs_warp.sim.sensor.color.encoding import decode, encode
from digs_warp.sim.sensor.color.image_noise import ReadNoise, ShotNoise
from digs_warp.sim.sensor.color.protocol import EyeImages
from digs_warp.sim.sensor.noise_field import octave_normal

SHAPE = (160, 240)
K = Intrinsics(SHAPE[1], SHAPE[0], 200.0, 200.0, SHAPE[1] / 2, SHAPE[0] / 2)
BASELINE = 0.1
SLOPES = ((0.02, 0.01, 20.0), (-0.03, 0.02, 14.0), (0.01, -0.02, 10.0))


def plane(a: float, b: float, c: float) -> np.ndarray:
    rows, columns = np.indices(SHAPE) + 0.5
    return a * columns + b * rows + c


def smooth(rng: np.random.Generator, length: float, *shape: int) -> np.ndarray:
    """Normal fields whose correlation falls to 1/e at ``length``: a Gaussian of half that width."""
    white = rng.standard_normal((int(np.prod(shape)), *SHAPE))
    fields = np.stack([gaussian_filter(field, length / 2, mode="wrap") for field in white])
    return np.sqrt(np.pi) * length * fields.reshape(*shape, *SHAPE)


def black(count: int) -> np.ndarray:
    return np.zeros((count, *SHAPE, 3), np.uint8)


def wall(disparities: list[np.ndarray]) -> Wall:
    """A wall from stacks of disparity, nearest first; images are black."""
    seen = np.ones(SHAPE, bool)
    poses = tuple(make_pose("test", d.astype(np.float32), black(len(d)), seen) for d in disparities)
    return Wall(K, BASELINE, poses)


def test_a_plane_is_found_among_other_surfaces_and_holes() -> None:
    disparity = plane(0.03, -0.02, 25.0)
    disparity[:, :60] += 8.0  # a pillar over a quarter of the image
    disparity[20:50, 100:200] = np.nan
    found = fit_plane(disparity.astype(np.float32))
    assert found is not None
    assert found.coefficients == pytest.approx((0.03, -0.02, 25.0), abs=1e-4)
    assert found.share == pytest.approx(
        np.isfinite(disparity[:, 60:]).sum() / np.isfinite(disparity).sum()
    )
    assert fit_plane(np.full(SHAPE, np.nan, np.float32)) is None


def test_a_noisy_plane_is_as_thick_as_five_standard_deviations() -> None:
    thick = 0.5 * np.random.default_rng(2).standard_normal(SHAPE)
    found = fit_plane(plane(0.03, -0.02, 25.0) + thick)
    assert found is not None and found.limit == pytest.approx(2.5, rel=0.1)


def test_noise_is_split_into_what_changes_what_stays_and_what_the_unit_has() -> None:
    rng = np.random.default_rng(4)
    field = 0.15 * smooth(rng, 15.0, 1)[0]
    stacks = [
        plane(*slope) + field + 0.08 * smooth(rng, 5.0, 1)[0] + 0.05 * smooth(rng, 3.0, 6)
        for slope in SLOPES
    ]
    found = noise(wall(stacks))
    for name, value, tolerance in (
        ("temporal", 0.05, 0.01),
        ("fixed", np.hypot(0.15, 0.08), 0.05),
        ("sigma", np.sqrt(0.15**2 + 0.08**2 + 0.05**2), 0.05),
        ("static_field", 0.15, 0.1),
    ):
        assert found[name].value == pytest.approx(value, rel=tolerance), name
        assert abs(found[name].value - value) < 3.5 * found[name].error, name
    alone = noise(wall([stacks[0][:1]]))
    assert not alone["temporal"].is_known and not alone["static_field"].is_known


def test_errors_hold_for_correlated_noise() -> None:
    """Of 60 fields, the true value lies within one stated error about two times in three."""
    rng = np.random.default_rng(0)
    blocks = block_numbers(SHAPE)
    misses = []
    for _ in range(60):
        square = smooth(rng, 8.0, 1)[0] ** 2
        sums = np.stack([block_sums(x, blocks) for x in (square, np.ones(SHAPE))], axis=1)
        sigma = jackknife(sums, ratio).root()
        misses.append(abs(sigma.value - 1) / sigma.error)
    assert 0.5 < np.mean(np.array(misses) < 1) < 0.85
    assert np.max(misses) < 4


@pytest.mark.parametrize(("sigma", "well"), [(1.0, 20_000.0), (3.0, 4_000.0)])
def test_image_noise_and_full_well_are_those_of_the_images(sigma: float, well: float) -> None:
    rig = replace(load_profile("zed2-720").rig(*SHAPE[::-1]), image_noise=sigma, full_well=well)
    ramp = np.repeat(np.linspace(30, 225, SHAPE[1])[None, :, None], 3, axis=2)
    linear = decode(np.rint(np.repeat(ramp, SHAPE[0], axis=0)).astype(np.uint8))
    rng = np.random.default_rng(2)
    frames = []
    for _ in range(6):
        eyes = EyeImages(rig.intrinsics, linear, linear)
        for effect in (ShotNoise(), ReadNoise()):
            eyes = effect.apply(eyes, rig, rng)
        frames.append(encode(eyes.left))
    found = image_noise([np.stack(frames)])
    assert found.mid_gray.value == pytest.approx(sigma, rel=0.01)
    assert found.full_well.value == pytest.approx(well, rel=0.06)
    assert found.is_still
    assert abs(found.mid_gray.value - sigma) < 3 * found.mid_gray.error
    assert abs(found.full_well.value - well) < 3 * found.full_well.error


def test_a_camera_that_moves_is_noticed() -> None:
    rng = np.random.default_rng(0)
    picture = gaussian_filter(rng.standard_normal((SHAPE[0], SHAPE[1] + 8)), 1.5) * 120 + 128
    still = np.stack([picture[:, 4:-4]] * 4)
    moving = np.stack([picture[:, 4 + i : 4 + i + SHAPE[1]] for i in (0, 1, -1, 1)])
    for stack, is_still in ((still, True), (moving, False)):
        noisy = stack + rng.standard_normal(stack.shape)
        images = np.repeat(np.clip(np.rint(noisy), 0, 255).astype(np.uint8)[..., None], 3, axis=3)
        assert image_noise([images]).is_still == is_still


@pytest.mark.parametrize("step", [1 / 4, 1 / 16, 1 / 32])
def test_the_step_is_the_largest_that_all_values_are_multiples_of(step: float) -> None:
    stack = plane(*SLOPES[0])[None] + 0.2 * np.random.default_rng(0).standard_normal((2, *SHAPE))
    assert disparity_step(wall([np.rint(stack / step) * step])) == Estimate(step, 0.0)
    assert not disparity_step(wall([stack])).is_known


def test_holes_are_counted_where_both_eyes_see_the_wall_within_what_was_reported() -> None:
    stack = np.repeat(plane(0.0, 0.0, 20.0)[None], 2, axis=0)
    stack[:, :, :20] = np.nan  # the right eye does not see these columns
    stack[:, 10:20, 100:110] = np.nan
    stack[:, ::10, 150:] = np.nan
    stack[:, 50, 60] = 40.0
    found = wall_holes(wall([stack]))
    inside = SHAPE[0] * (SHAPE[1] - 20)
    lines = len(range(0, SHAPE[0], 10))
    assert found["holes"].value == pytest.approx((100 + 90 * lines) / inside, rel=0.01)
    assert found["wrong"].value == pytest.approx(1 / inside, rel=0.1)
    assert found["hole count"].value == pytest.approx(1e4 * (1 + lines) / inside)
    slope = plane(*SLOPES[0])[None].copy()
    slope[(slope > 24.0) | (slope < 22.0)] = np.nan
    cut = wall([slope])
    assert depth_range(cut) == pytest.approx((K.fx * BASELINE / 24, K.fx * BASELINE / 22), rel=1e-3)
    assert wall_holes(cut)["holes"].value < 0.002, "beyond the range are no holes"


def test_bias_is_a_line_through_the_poses() -> None:
    recorded = wall([(1.004 * plane(*slope) + 0.3)[None] for slope in SLOPES])
    true = [a * K.cx + b * K.cy + c for a, b, c in SLOPES]
    distances = [K.fx * BASELINE / each for each in true]
    found = bias(recorded, distances)
    assert found.offset.value == pytest.approx(0.3, abs=1e-3)
    assert found.scale.value == pytest.approx(1.004, abs=1e-4)
    figures, drift = found.figures(K.fx), found.drift(K.fx)
    assert figures["rotation_drift"].value == pytest.approx(np.rad2deg(0.3 / K.fx), rel=1e-2)
    assert figures["baseline_drift"].value == pytest.approx(0.004, rel=0.03)
    for slope in true:  # the drift shows what was measured
        square = np.full((1, 1), slope, np.float32)
        axis = Intrinsics(1, 1, K.fx, K.fy, 0.5, 0.5)
        shown = drift.reported_disparity(drift.shown_disparity(square, axis))
        assert shown == pytest.approx(1.004 * slope + 0.3, abs=0.01)
    assert not bias(recorded, None).scale.is_known
    assert not bias(
        wall([plane(*slope)[None] for slope in SLOPES[:2]]), distances[:2]
    ).scale.is_known
    assert not bias(recorded, [1.0, 1.1, 1.2]).scale.is_known, "too near to each other"


def test_the_error_of_a_line_covers_what_few_points_scatter() -> None:
    rng = np.random.default_rng(0)
    x = np.array([10.0, 20.0, 30.0, 40.0, 50.0])
    within = [abs(o.value - 1) < 2 * o.error
              for o, _ in (fit_line(x, 2 * x + 1 + rng.standard_normal(5)) for _ in range(300))]  # fmt: skip
    assert np.mean(within) > 0.93


def test_roughness_is_that_of_planes_without_holes_or_steps() -> None:
    disparity = plane(0.02, -0.01, 20.0) + 0.05 * np.random.default_rng(0).standard_normal(SHAPE)
    disparity[:, 150:] += 10.0
    disparity[100, 100] = np.nan
    found = roughness(disparity, 32)
    assert len(found.residual) == 5 * 6 - 1
    assert found.median() == pytest.approx(0.05, rel=0.02)
    assert found.estimate.error < 0.002
    assert roughness(disparity, 24).median(0, 26) == pytest.approx(0.05, rel=0.02)
    assert np.isnan(found.median(100, 200))


@pytest.mark.parametrize("correlation", [0.0, 3.0, 12.0, 30.0])
def test_the_growth_of_roughness_tells_the_correlation(correlation: float) -> None:
    field = 0.1 * octave_normal(np.random.default_rng(0), (960, 1280), correlation)
    found = correlation_of([roughness(field, size).median() for size in WINDOWS])
    assert found == pytest.approx(correlation, rel=0.3)


def test_two_windows_tell_no_correlation() -> None:
    assert np.isnan(correlation_of([0.02, 0.03, np.nan, np.nan]))


def test_what_changes_and_what_stays_are_told_apart() -> None:
    rng = np.random.default_rng(0)
    stack = 0.3 * rng.standard_normal(SHAPE) + 0.1 * rng.standard_normal((8, *SHAPE))
    stack[2, 5, 5] = np.nan
    assert temporal_share(stack) == pytest.approx(0.1, rel=0.05)


def test_holes_are_counted_with_their_corners() -> None:
    disparity = np.ones((100, 100))
    disparity[10, 10] = disparity[11, 11] = np.nan  # one hole of two pixels
    disparity[40:44, 40:44] = np.nan
    found = holes(disparity)
    assert (found.share, found.per_10000) == (18 / 10_000, 2)
    assert found.small == pytest.approx(2 / 18)
