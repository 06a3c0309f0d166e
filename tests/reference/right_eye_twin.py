"""Which points the right eye sees, decided point by point in float64; see sim.sensor.right_eye."""

import numpy as np

from digs_warp.sim.sensor.right_eye import HIDDEN, SEEN, UNSURE


def classified(disparity: np.ndarray, opaque: np.ndarray) -> np.ndarray:
    """Return SEEN, UNSURE or HIDDEN for each pixel, (height, width), uint8."""
    state = np.full(disparity.shape, SEEN, dtype=np.uint8)
    for row in range(disparity.shape[0]):
        for column in range(disparity.shape[1]):
            if may_be_hidden(disparity[row], column):
                covered = is_covered(disparity[row], opaque[row], column)
                state[row, column] = HIDDEN if covered else UNSURE
    return state


def may_be_hidden(disparity: np.ndarray, column: int) -> bool:
    """Whether a point further right lands left of this one, give or take half a pixel, in one row."""
    landing = np.arange(len(disparity)) - np.asarray(disparity, np.float64)
    ahead = landing[column + 1 :] < landing[column] + 0.5
    return bool(landing[column] >= -0.5 and ahead.any())


def is_covered(disparity: np.ndarray, opaque: np.ndarray, column: int) -> bool:
    """Whether the three pixels round the point's place in the right image show one nearer surface."""
    width = len(disparity)
    if width < 3:
        return False
    landing = np.arange(width) - np.asarray(opaque, np.float64)
    middle = int(np.clip(np.floor(column - disparity[column]), 1, width - 2))
    shown = []
    for place in (middle - 1, middle, middle + 1):
        here = opaque[np.floor(landing) == place]
        # Of several points that land together the right image shows the one further right.
        shown.append(float(here[-1]) if len(here) else np.nan)
    left, here, right = shown
    closed = abs(left - here) < 1 and abs(right - here) < 1
    return closed and min(shown) > disparity[column] + 1
