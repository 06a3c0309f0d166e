"""What the right eye cannot see: decided from disparity where that is safe, by rays elsewhere.

Safe is only one direction: a closed surface that both eyes see covers what lands behind it. That nothing
nearer lands somewhere proves nothing: sides of things that the left eye does not see hide as well.
"""

import numpy as np

from sim.sensor.frame import FrameTruth
from sim.sensor.landings import HIDDEN, UNSURE, classify
from sim.sensor.materials import is_transparent, pixels_of


def hidden_from_right(truth: FrameTruth) -> np.ndarray:
    """Return which pixels something opaque hides from the right eye, (height, width), bool.

    Points that land outside the right image are left out: that is the invalid band, not occlusion.
    """
    opaque = truth.disparity
    transparent = pixels_of(truth, is_transparent)
    if transparent is not None:
        opaque = np.where(transparent, np.float32(np.nan), opaque)
    state = classify(truth.disparity, opaque)
    hidden, unsure = state == HIDDEN, state == UNSURE
    if unsure.any():
        hidden |= unsure & ~truth.rays.right_visibility(unsure)
    return hidden
