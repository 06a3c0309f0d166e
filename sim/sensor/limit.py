"""The range of the camera: a hard limit on what it reports, whatever the effects made of the frame."""

import numpy as np

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.cause import Cause
from digs_warp.sim.sensor.frame import Sensed

# A depth right at the end is in range, however it is rounded.
ROUNDING = 5e-7


def within_range(sensed: Sensed, rig: StereoRig) -> Sensed:
    """Return the frame with holes where the sensed depth is out of range, labeled too near or too far.

    Disparities of 0 and below, which noise makes of small ones, are too far.
    """
    smallest = rig.focal_baseline / rig.max_depth
    sensed = sensed.with_holes(sensed.disparity > np.float32(rig.largest_disparity), Cause.NEAR)
    return sensed.with_holes(sensed.disparity < np.float32(smallest * (1 - ROUNDING)), Cause.FAR)


def round_into_range(depth: np.ndarray, rig: StereoRig) -> None:
    """Move depths that only rounding put past an end of the range to that end, in place."""
    for end, past in (
        (rig.max_depth, depth > rig.max_depth),
        (rig.min_depth, depth < rig.min_depth),
    ):
        depth[past & (np.abs(depth - end) < 2 * ROUNDING * end)] = end
