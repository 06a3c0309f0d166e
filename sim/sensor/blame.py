"""Why a matched pixel is missing or wrong, worked out from the truth: labels for a matcher's disparity."""

import numpy as np

from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.claims import WRONG, strongest_claims
from digs_warp.sim.sensor.frame import FrameTruth

__all__ = ["WRONG", "blame"]


def blame(disparity: np.ndarray, truth: FrameTruth) -> np.ndarray:
    """Return the most likely `Cause` of each missing or wrong pixel, (height, width), uint8.

    Where several causes apply, the first of these wins: range, a match that is wrong only by the drifted
    calibration, band, occlusion, mirror, glass, exposure, gloss, edge, weak texture, misaligned rows. Where
    none applies, the cause is random.

    Args:
        disparity: as the camera reports it [px], (height, width), NaN where it found nothing.
        truth: of the frame.
    """
    cause, is_open = strongest_claims(disparity, truth)
    # Rays are cast only where the answer would count.
    cause[truth.hidden_among(is_open)] = Cause.OCCLUDED
    return cause
