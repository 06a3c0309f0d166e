"""Attributes each missing or wrong pixel of a match to its cause, from the truth."""

from collections.abc import Callable

import numpy as np

from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.drift import NO_DRIFT
from digs_warp.sim.sensor.facts import DARK, SATURATED, STEP
from digs_warp.sim.sensor.frame import (
    MATCHABLE_SNR,
    Cause,
    FrameTruth,
    is_glossy,
    is_mirror,
    is_transparent,
)
from digs_warp.sim.sensor.steps import near_steps

# Matches with larger errors are wrong, not just noisy [px] ("bad-1" of the Middlebury benchmark).
WRONG = 1.0


def attribute_errors(disparity: np.ndarray, truth: FrameTruth) -> np.ndarray:
    """Return the most likely `Cause` of each missing or wrong pixel, (height, width), uint8.

    Where several causes apply, the first of these wins: range, a match that is wrong only by the drifted
    calibration, band, occlusion, mirror, glass, exposure, gloss, edge, weak texture, misaligned rows. Where
    none applies, the cause is random.

    Args:
        disparity: as the camera reports it [px], (height, width), NaN where it found nothing.
        truth: of the frame.
    """
    true, rig = truth.disparity, truth.rig
    at = np.flatnonzero(~(np.abs(disparity - true) <= WRONG) & ~np.isnan(true))
    here, gray, depth = (image.reshape(-1)[at] for image in (true, truth.gray, truth.depth))
    drifted, misaligned = _claims_of_drift(disparity, truth, at)
    strong = (
        ((true > np.arange(0.5, true.shape[1], dtype=np.float32)).reshape(-1)[at], Cause.BAND),
        (drifted, Cause.RECTIFICATION),
        (depth > rig.max_depth, Cause.FAR),
        (here > rig.largest_disparity, Cause.NEAR),
    )
    # Rays are cast only where the answer would count.
    in_question = np.zeros(true.shape, bool)
    in_question.reshape(-1)[at] = ~(strong[0][0] | strong[1][0] | strong[2][0] | strong[3][0])
    hidden = truth.hidden_among(in_question).reshape(-1)[at]
    edges = near_steps(true, STEP, rig.window // 2 + 1).reshape(-1)[at]
    texture = truth.texture_snr.reshape(-1)[at]
    labels = np.full(len(at), Cause.RANDOM, np.uint8)
    # From the weakest to the strongest claim: later ones overwrite earlier ones.
    for where, label in (
        (misaligned, Cause.RECTIFICATION),
        (texture < MATCHABLE_SNR, Cause.WEAK_TEXTURE),
        (edges, Cause.EDGE),
        (_made_of(is_glossy, truth, at), Cause.SPECULAR),
        ((gray > SATURATED) | (gray < DARK), Cause.EXPOSURE),
        (_made_of(is_transparent, truth, at), Cause.TRANSPARENT),
        (_made_of(is_mirror, truth, at), Cause.MIRROR),
        (hidden, Cause.OCCLUDED),
        *strong,
    ):
        np.copyto(labels, np.uint8(label), where=where)
    cause = np.full(true.shape, Cause.OK, np.uint8)
    cause.reshape(-1)[at] = labels
    return cause


def _made_of(test: Callable[[Material], bool], truth: FrameTruth, at: np.ndarray) -> np.ndarray:
    """Return at which pixels the material passes a test."""
    pixels = truth.pixels_of(test)
    return np.zeros(len(at), bool) if pixels is None else pixels.reshape(-1)[at]


def _claims_of_drift(
    disparity: np.ndarray, truth: FrameTruth, at: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return which pixels match what the drifted eye shows, and where its rows are off by over a pixel."""
    if truth.drift == NO_DRIFT:
        return np.zeros(len(at), bool), np.zeros(len(at), bool)
    true = truth.disparity.reshape(-1)[at].astype(np.float64)
    rows, columns = (place + 0.5 for place in np.divmod(at, truth.disparity.shape[1]))
    across, down = truth.drift.shift(columns - true, rows, truth.rig.intrinsics)
    expected = truth.drift.reported_disparity(true - across)
    return np.abs(disparity.reshape(-1)[at] - expected) <= WRONG, np.abs(down) > WRONG
