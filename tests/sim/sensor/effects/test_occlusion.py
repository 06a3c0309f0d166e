"""Occlusion: where it lies, how wide it is, what becomes of it."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.effects.occlusion import (
    FAR_REACH,
    HOLE_SHARES_FAR,
    HOLE_SHARES_NEAR,
    NEAR_GAINS,
    NEAR_REACH,
    NEAR_SNRS,
    RUN_LENGTHS,
    Occlusion,
    hole_share,
)
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.right_eye import SEEN, classify
from reference.stereo_frames import make_frame, make_rig
from reference.stereo_pairs import HiddenRays, box_frame

FAR = 8.0


def occluded(
    near: float, strength: float = 1.0, number: int = 0
) -> tuple[Sensed, FrameTruth, tuple[slice, slice]]:
    truth, box = box_frame(near, FAR, number=number)
    rng = np.random.default_rng(number)
    return Occlusion().apply(Sensed.of(truth), truth, rng, strength), truth, box


@pytest.mark.parametrize("step", [10, 24, 40])
def test_the_hole_lies_left_of_the_near_thing_and_is_as_wide_as_the_step(step: int) -> None:
    sensed, _, (rows, columns) = occluded(FAR + step)
    touched = sensed.cause == Cause.OCCLUDED
    assert not touched[: rows.start].any() and not touched[rows.stop :].any()
    assert not touched[:, columns.start :].any()  # nothing on the thing, nothing to its right
    assert not touched[:, : columns.start - step - 1].any()
    # A tenth is right by chance and keeps its label; the outline of the rest is the step.
    assert touched[:, columns.start - step].any() and touched[:, columns.start - 1].any()
    assert touched[rows].sum() / (rows.stop - rows.start) > 0.85 * step


def test_holes_and_wrong_depth_have_the_measured_shares() -> None:
    """Many frames of a run of 30 px: 0.36 beside what hides it, 0.86 from 12 px on."""
    holes, wrong, right = [], [], []
    for number in range(12):
        sensed, _, (rows, columns) = occluded(FAR + 30, number=number)
        hidden = sensed.disparity[rows, columns.start - 30 : columns.start]
        holes.append(np.isnan(hidden).mean(axis=0)[::-1])
        values = hidden[~np.isnan(hidden)]
        wrong.append((values > FAR + 1).mean())
        right.append((values == FAR).mean())
    by_distance = np.mean(holes, axis=0)
    assert by_distance[:2].mean() == pytest.approx(0.38, abs=0.08)
    assert by_distance[12:].mean() == pytest.approx(0.86, abs=0.05)
    assert 0.8 < np.mean(wrong) < 1.0
    assert 0.02 < np.mean(right) < 0.2


def test_wrong_depth_lies_between_the_far_and_the_near_side() -> None:
    frames = [occluded(FAR + 16, number=number)[0] for number in range(12)]
    values = np.concatenate([s.disparity[s.cause == Cause.OCCLUDED] for s in frames])
    confidence = np.concatenate([s.confidence[s.cause == Cause.OCCLUDED] for s in frames])
    assert (confidence[np.isnan(values)] == 0).all()
    assert (confidence[~np.isnan(values)] > 0.5).all()  # wrong, and sure of it
    values = values[~np.isnan(values)]
    assert (values > FAR).all() and (values <= FAR + 16).all()
    # Of the wrong ones, 75 of 90 take the disparity of what hides them.
    assert (values == FAR + 16).mean() == pytest.approx(75 / 90, abs=0.1)


def test_long_runs_lose_more_than_short_ones_and_far_pixels_more_than_near_ones() -> None:
    plenty = 16.0  # gradient over noise at an outline
    lengths = np.arange(1.0, 150.0)
    far, outline = np.full_like(lengths, 20.0), np.full_like(lengths, plenty)
    assert (np.diff(hole_share(lengths, far, outline)) >= 0).all()
    distance = np.arange(1.0, 60.0)
    long, outline = np.full_like(distance, 60.0), np.full_like(distance, plenty)
    assert (np.diff(hole_share(long, distance, outline)) >= 0).all()
    # Texture decides beside what hides a pixel, and has no say far from it.
    snr = np.array([0.5, 3.0, 10.0, 50.0])
    ones = np.ones_like(snr)
    assert (np.diff(hole_share(60 * ones, 2 * ones, snr)) < 0).all()
    assert np.ptp(hole_share(60 * ones, 20 * ones, snr)) == 0


def test_shares_of_holes_lie_on_the_measured_curves() -> None:
    length, distance = (axis.ravel() for axis in np.meshgrid(np.arange(1, 131), np.arange(1, 21)))
    snr = np.random.default_rng(0).uniform(0, 60, length.size)
    near = np.interp(length, RUN_LENGTHS, HOLE_SHARES_NEAR) * np.interp(snr, NEAR_SNRS, NEAR_GAINS)
    far = np.interp(length, RUN_LENGTHS, HOLE_SHARES_FAR)
    away = np.clip((distance - NEAR_REACH) / (FAR_REACH - NEAR_REACH), 0, 1)
    expected = near * (1 - away) + far * away
    np.testing.assert_allclose(hole_share(length, distance, snr), expected, rtol=1e-12)


def test_holes_grow_with_strength() -> None:
    counts = [
        np.isnan(occluded(FAR + 20, strength)[0].disparity).sum() for strength in (0, 0.5, 1, 2, 4)
    ]
    assert counts[0] == 0 and (np.diff(counts) > 0).all()


def test_what_lands_outside_the_right_image_is_no_occlusion() -> None:
    rig = make_rig(64, 8)
    disparity = np.full((8, 64), 30.0)
    truth = replace(make_frame(disparity, rig), rays=HiddenRays(np.ones((8, 64), dtype=bool)))
    sensed = Occlusion().apply(Sensed.of(truth), truth, np.random.default_rng(0))
    assert (sensed.cause == Cause.OK).all()


def test_rays_are_asked_only_where_something_nearer_may_hide() -> None:
    """All hidden pixels of random boxes are among the candidates, and few others."""
    rng = np.random.default_rng(1)
    disparity = np.full((60, 200), 5.0)
    for _ in range(12):
        top, left = rng.integers(0, 50), rng.integers(0, 180)
        box = disparity[top : top + 10, left : left + 20]
        box[:] = np.maximum(box, rng.uniform(6, 30))
    # Brute force: something further right lands within half a pixel and is nearer.
    columns = np.arange(200.0)
    landing = columns - disparity
    nearer = disparity[:, None, :] > disparity[:, :, None] + 1e-6
    same = np.abs(landing[:, None, :] - landing[:, :, None]) <= 0.5
    hidden = (nearer & same).any(axis=2) & (landing >= 0)
    candidates = classify(disparity, disparity) != SEEN
    assert hidden.sum() > 500
    assert (hidden & ~candidates).sum() == 0
    assert candidates.sum() < 2.5 * hidden.sum()


def test_a_flat_scene_asks_for_no_ray() -> None:
    truth = make_frame(12.0)
    assert (classify(truth.disparity, truth.disparity) == SEEN).all()
