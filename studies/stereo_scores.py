"""How far sensed disparity is from the truth, with the measures of the Middlebury stereo benchmark."""

from dataclasses import dataclass

import numpy as np

from digs_warp.sim.sensor.error_attribution import WRONG
from digs_warp.sim.sensor.facts import STEP
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.steps import near_steps

# Pixels this close to a depth step count as edge pixels.
EDGE_RADIUS = 2


@dataclass(frozen=True, kw_only=True)
class Scores:
    """Shares from 0 to 1; NaN where there is nothing to count.

    Attributes:
        fill: share of the pixels with true depth that have a value.
        bad_1: share of the values with errors above one pixel.
        rms: RMS error of the other values [px].
        edge_bad_1: ``bad_1`` within two pixels of a depth step.
        occluded_holes: share of the pixels hidden from the right eye that have no value.
        occluded_bad_1: ``bad_1`` among the hidden pixels.
        visible_holes: share of the pixels seen by both eyes that have no value.
    """

    fill: float
    bad_1: float
    rms: float
    edge_bad_1: float
    occluded_holes: float
    occluded_bad_1: float
    visible_holes: float


def score(disparity: np.ndarray, truth: FrameTruth) -> Scores:
    """Compare sensed disparity [px], (height, width), NaN where missing, with the truth of its frame."""
    true = truth.disparity
    known = ~np.isnan(true)
    filled = known & ~np.isnan(disparity)
    error = np.abs(disparity - true)
    bad = filled & (error > WRONG)
    edge = near_steps(true, STEP, EDGE_RADIUS)
    inside = true <= np.arange(true.shape[1]) + 0.5  # not in the band that the right image lacks
    seen = truth.rays.right_visibility(np.ones(true.shape, bool), truth.depth)
    hidden, visible = known & inside & ~seen, known & inside & seen
    good = error[filled & ~bad]
    return Scores(
        fill=share_of(filled, known),
        bad_1=share_of(bad, filled),
        rms=float(np.sqrt(np.mean(np.square(good)))) if good.size else np.nan,
        edge_bad_1=share_of(bad, filled & edge),
        occluded_holes=share_of(~filled, hidden),
        occluded_bad_1=share_of(bad, hidden & filled),
        visible_holes=share_of(~filled, visible),
    )


def share_of(part: np.ndarray, whole: np.ndarray) -> float:
    """Return the share of a mask that is in another one, too; NaN where it is empty."""
    count = np.count_nonzero(whole)
    return float(np.count_nonzero(part & whole) / count) if count else np.nan
