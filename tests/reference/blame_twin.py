"""Why a match is missing or wrong, one cause after another over the whole image; see error_attribution."""

import numpy as np

from digs_warp.sim.sensor.drift import NO_DRIFT
from digs_warp.sim.sensor.error_attribution import WRONG
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


def blame_twin(disparity: np.ndarray, truth: FrameTruth) -> np.ndarray:
    """Return the label of each pixel, (height, width), uint8."""
    true, gray, rig = truth.disparity, truth.gray, truth.rig
    failed = ~(np.abs(disparity - true) <= WRONG) & ~np.isnan(true)
    columns = np.arange(true.shape[1]) + 0.5
    drifted, misaligned = _claims_of_drift(disparity, truth)
    cause = np.full(true.shape, Cause.RANDOM, np.uint8)
    # From the weakest to the strongest claim: later ones overwrite earlier ones.
    for where, label in (
        (misaligned, Cause.RECTIFICATION),
        (truth.texture_snr < MATCHABLE_SNR, Cause.WEAK_TEXTURE),
        (near_steps(true, STEP, rig.window // 2 + 1), Cause.EDGE),
        (truth.pixels_of(is_glossy), Cause.SPECULAR),
        ((gray > SATURATED) | (gray < DARK), Cause.EXPOSURE),
        (truth.pixels_of(is_transparent), Cause.TRANSPARENT),
        (truth.pixels_of(is_mirror), Cause.MIRROR),
        (truth.hidden_among(failed & ~(true > columns)), Cause.OCCLUDED),
        (true > columns, Cause.BAND),
        (drifted, Cause.RECTIFICATION),
        (truth.depth > rig.max_depth, Cause.FAR),
        (true > rig.largest_disparity, Cause.NEAR),
        (~failed, Cause.OK),
    ):
        if where is not None:
            cause[where] = label
    return cause


def _claims_of_drift(
    disparity: np.ndarray, truth: FrameTruth
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Return where the right match became wrong by the drift, and where the rows are off by over a pixel."""
    if truth.drift == NO_DRIFT:
        return None, None
    drift, true = truth.drift, truth.disparity.astype(np.float64)
    rows, columns = np.indices(true.shape) + 0.5
    across, down = drift.shift(columns - true, rows, truth.rig.intrinsics)
    expected = drift.reported_disparity(true - across)
    return np.abs(disparity - expected) <= WRONG, np.abs(down) > WRONG
