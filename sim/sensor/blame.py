"""Why a matched pixel is missing or wrong, worked out from the truth: labels for a matcher's disparity."""

import numpy as np

from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.facts import DARK, SATURATED, STEP
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.materials import is_glossy, is_mirror, is_transparent, pixels_of
from digs_warp.sim.sensor.steps import near_steps
from digs_warp.sim.sensor.texture import MATCHABLE_SNR

# Matches with larger errors are wrong, not just noisy [px] ("bad-1" of the Middlebury benchmark).
WRONG = 1.0


def blame(disparity: np.ndarray, truth: FrameTruth) -> np.ndarray:
    """Return the most likely `Cause` of each missing or wrong pixel, (height, width), uint8.

    Where several causes apply, the first of these wins: range, band, occlusion, mirror, glass, exposure,
    gloss, edge, weak texture. Where none applies, the cause is random.

    Args:
        disparity: from a matcher [px], (height, width), NaN where it found nothing.
        truth: of the frame.
    """
    true = truth.disparity
    cause = np.full(true.shape, Cause.OK, dtype=np.uint8)
    failed = ~(np.abs(disparity - true) <= WRONG) & ~np.isnan(true)
    # From the weakest to the strongest claim: later ones overwrite earlier ones.
    cause[failed] = Cause.RANDOM
    for where, label in _claims(truth):
        if where is not None:
            cause[failed & where] = label
    return cause


def _claims(truth: FrameTruth) -> list[tuple[np.ndarray | None, Cause]]:
    true, gray, rig = truth.disparity, truth.gray, truth.rig
    columns = np.arange(true.shape[1]) + 0.5
    return [
        (truth.texture_snr < MATCHABLE_SNR, Cause.WEAK_TEXTURE),
        (near_steps(true, STEP, rig.window // 2 + 1), Cause.EDGE),
        (pixels_of(truth, is_glossy), Cause.SPECULAR),
        ((gray > SATURATED) | (gray < DARK), Cause.EXPOSURE),
        (pixels_of(truth, is_transparent), Cause.TRANSPARENT),
        (pixels_of(truth, is_mirror), Cause.MIRROR),
        (truth.hidden, Cause.OCCLUDED),
        (true > columns, Cause.BAND),
        (truth.depth > rig.max_depth, Cause.FAR),
        (true > rig.largest_disparity, Cause.NEAR),
    ]
