"""What the right eye cannot see: decided from disparity where that is safe, by rays elsewhere.

Safe is only one direction: a closed surface that both eyes see covers what lands behind it. That nothing
nearer lands somewhere proves nothing: sides of things that the left eye does not see hide as well.
"""

from collections.abc import Callable

import numpy as np

from digs_warp.sim.sensor.landings import HIDDEN, UNSURE, classify


def hidden_from_right(
    disparity: np.ndarray, opaque: np.ndarray, right_visibility: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """Return which pixels something opaque hides from the right eye, (height, width), bool.

    Points that land outside the right image are left out: that is the invalid band, not occlusion.

    Args:
        disparity: [px], (height, width), NaN where there is nothing.
        opaque: the same without what can be seen through.
        right_visibility: tells by rays whether the right eye sees the pixels it is given, both
            (height, width), bool; see `digs_warp.sim.sensor.frame.FrameRays`.
    """
    state = classify(disparity, opaque)
    hidden, unsure = state == HIDDEN, state == UNSURE
    if unsure.any():
        hidden |= unsure & ~right_visibility(unsure)
    return hidden
