"""Edge fattening: which way and how far outlines move, and what closes."""

import numpy as np
import pytest

from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.effects.edge_fattening import EdgeFattening, outline_shift
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from reference.stereo_frames import broadband, make_frame, make_rig
from reference.stereo_pairs import box_frame

FAR, NEAR = 10.0, 30.0


def fattened(truth: FrameTruth, strength: float = 1.0, seed: int = 0) -> Sensed:
    return EdgeFattening().apply(Sensed.of(truth), truth, np.random.default_rng(seed), strength)


def growth(sensed: Sensed, truth: FrameTruth, box: tuple[slice, slice]) -> float:
    """By how many pixels the outline has moved out at the left and the right side, in the mean."""
    near = np.abs(sensed.disparity - NEAR) < 1
    rows = slice(box[0].start + 10, box[0].stop - 10)
    return (near[rows].sum() - (truth.disparity[rows] == NEAR).sum()) / 2 / (rows.stop - rows.start)


@pytest.mark.parametrize("window", [5, 9, 15])
def test_strong_foreground_grows_and_weak_foreground_shrinks(window: int) -> None:
    """The measured ranges, a little widened because outlines of real frames vary more."""
    ranges = {
        5: ((1.5, 2.9), (-1.9, -0.7)),
        9: ((2.4, 4.0), (-2.7, -1.3)),
        15: ((3.6, 6), (-4, -1.7)),
    }
    rig = make_rig(window=window)
    strong, weak = (
        np.mean([growth(fattened(truth, seed=seed), truth, box) for seed in range(6)])
        for truth, box in (
            box_frame(NEAR, FAR, 1.0, 0.04, rig),
            box_frame(NEAR, FAR, 0.04, 1.0, rig),
        )
    )
    low, high = ranges[window][0]
    assert low < strong < high
    low, high = ranges[window][1]
    assert low < weak < high


def test_equal_texture_moves_outlines_by_less_than_a_pixel() -> None:
    shift = np.mean(
        [
            growth(fattened(truth, seed=s), truth, box)
            for s in range(4)
            for truth, box in [box_frame(NEAR, FAR)]
        ]
    )
    assert abs(shift) < 1.0


def test_the_shift_rises_with_contrast_and_flips_its_sign() -> None:
    ratio = np.geomspace(0.1, 10, 41)
    shift = outline_shift(4 * ratio, np.full_like(ratio, 4.0), half=2)
    assert (np.diff(shift) >= 0).all()
    assert shift[0] == pytest.approx(-1.55, abs=0.05) and shift[-1] == pytest.approx(2.2, abs=0.05)


@pytest.mark.parametrize(("noise", "least", "most"), [(0.3, 0.3, 0.7), (8.0, 0.75, 1.3)])
def test_outlines_move_less_along_columns_unless_the_background_drowns_in_noise(
    noise: float, least: float, most: float
) -> None:
    truth, (rows, columns) = box_frame(NEAR, FAR, 1.0, 0.1, make_rig(image_noise=noise))
    ratios = []
    for seed in range(6):
        sensed = fattened(truth, seed=seed)
        near = np.abs(sensed.disparity - NEAR) < 1
        upright = near[:, columns.start + 20 : columns.stop - 20].sum(axis=0).mean()
        grown = (upright - (rows.stop - rows.start)) / 2
        ratios.append(grown / growth(sensed, truth, (rows, columns)))
    assert least < np.mean(ratios) < most


def test_only_pixels_beside_the_outline_change() -> None:
    truth, (rows, columns) = box_frame(NEAR, FAR, 1.0, 0.04)
    moved = fattened(truth).cause == Cause.EDGE
    zone = np.zeros_like(moved)
    zone[rows.start - 15 : rows.stop + 15, columns.start - 15 : columns.stop + 15] = True
    zone[rows.start + 15 : rows.stop - 15, columns.start + 15 : columns.stop - 15] = False
    assert moved.any() and not (moved & ~zone).any()
    values = fattened(truth).disparity[moved]
    assert np.isin(values[~np.isnan(values)], [NEAR, FAR]).all()


def test_strength_scales_the_shift() -> None:
    truth, box = box_frame(NEAR, FAR, 1.0, 0.04)
    one, two = (growth(fattened(truth, s), truth, box) for s in (1.0, 2.0))
    assert two == pytest.approx(2 * one, rel=0.2)
    assert fattened(truth, 0.0).disparity is truth.disparity


def slats(gap: int, bar: int) -> FrameTruth:
    """Vertical near bars before a far plane."""
    rig = make_rig()
    disparity = np.full((240, 320), FAR)
    for left in range(40, 280, gap + bar):
        disparity[:, left : left + bar] = NEAR
    return make_frame(disparity, rig, broadband((240, 320)))


def test_narrow_gaps_close_more_than_wide_ones() -> None:
    shares = []
    for gap in (4, 9, 16, 30):
        truth = slats(gap, 14)
        sensed = fattened(truth)
        inside = (truth.disparity == FAR) & (np.arange(320) > 54) & (np.arange(320) < 250)
        shares.append((sensed.disparity == NEAR)[inside].mean())
    assert shares[0] > 0.6 and (np.diff(shares) < 0).all()


def test_bars_as_narrow_as_closing_gaps_survive() -> None:
    truth = slats(40, 6)
    sensed = fattened(truth)
    assert (np.abs(sensed.disparity - NEAR) < 1)[truth.disparity == NEAR].mean() > 0.7
