"""Why a matched pixel is missing or wrong, worked out from the truth: labels for a matcher's disparity."""

import numpy as np

from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.drift import NO_DRIFT
from digs_warp.sim.sensor.facts import DARK, SATURATED, STEP
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.materials import is_glossy, is_mirror, is_transparent, pixels_of
from digs_warp.sim.sensor.steps import near_steps, pixels_where
from digs_warp.sim.sensor.texture import MATCHABLE_SNR

# Matches with larger errors are wrong, not just noisy [px] ("bad-1" of the Middlebury benchmark).
WRONG = 1.0


def blame(disparity: np.ndarray, truth: FrameTruth) -> np.ndarray:
    """Return the most likely `Cause` of each missing or wrong pixel, (height, width), uint8.

    Where several causes apply, the first of these wins: range, a match that is wrong only by the drifted
    calibration, band, occlusion, mirror, glass, exposure, gloss, edge, weak texture, misaligned rows. Where
    none applies, the cause is random.

    Args:
        disparity: as the camera reports it [px], (height, width), NaN where it found nothing.
        truth: of the frame.
    """
    true = truth.disparity
    cause = np.full(true.shape, Cause.OK, dtype=np.uint8)
    failed = ~(np.abs(disparity - true) <= WRONG) & ~np.isnan(true)
    at = np.flatnonzero(failed)
    labels = np.full(len(at), Cause.RANDOM, dtype=np.uint8)
    # From the weakest to the strongest claim: later ones overwrite earlier ones.
    drifted, misaligned = _claims_of_drift(failed, disparity, truth)
    claims = [(misaligned, Cause.RECTIFICATION), *_claims(failed, truth, drifted)]
    for where, label in claims:
        if where is not None:
            labels[where.reshape(-1)[at]] = label
    cause.reshape(-1)[at] = labels
    return cause


def _claims_of_drift(
    failed: np.ndarray, disparity: np.ndarray, truth: FrameTruth
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Return where the right match became wrong by the drift, and where the rows are off by over a pixel.

    Both are (height, width), bool, and None without drift.
    """
    if truth.drift == NO_DRIFT:
        return None, None
    drift, (rows, columns) = truth.drift, pixels_where(failed)
    true = truth.disparity[rows, columns].astype(np.float64)
    across, down = drift.shift(columns + 0.5 - true, rows + 0.5, truth.rig.intrinsics)
    expected = drift.reported_disparity(true - across)
    drifted, misaligned = np.zeros_like(failed), np.zeros_like(failed)
    drifted[rows, columns] = np.abs(disparity[rows, columns] - expected) <= WRONG
    misaligned[rows, columns] = np.abs(down) > WRONG
    return drifted, misaligned


def _claims(
    failed: np.ndarray, truth: FrameTruth, drifted: np.ndarray | None
) -> list[tuple[np.ndarray | None, Cause]]:
    true, gray, rig = truth.disparity, truth.gray, truth.rig
    columns = np.arange(true.shape[1]) + 0.5
    return [
        (truth.texture_snr < MATCHABLE_SNR, Cause.WEAK_TEXTURE),
        (near_steps(true, STEP, rig.window // 2 + 1), Cause.EDGE),
        (pixels_of(truth, is_glossy), Cause.SPECULAR),
        ((gray > SATURATED) | (gray < DARK), Cause.EXPOSURE),
        (pixels_of(truth, is_transparent), Cause.TRANSPARENT),
        (pixels_of(truth, is_mirror), Cause.MIRROR),
        (truth.hidden_among(failed & ~(true > columns)), Cause.OCCLUDED),
        (true > columns, Cause.BAND),
        (drifted, Cause.RECTIFICATION),
        (truth.depth > rig.max_depth, Cause.FAR),
        (true > rig.largest_disparity, Cause.NEAR),
    ]
