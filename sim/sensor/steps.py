"""Where disparity jumps from one pixel to the next."""

import numpy as np

from digs_warp.sim.sensor.filters import dilate


def near_steps(disparity: np.ndarray, threshold: float, radius: int) -> np.ndarray:
    """Return the pixels within ``radius`` pixels of a step of more than ``threshold`` [px].

    The distance is the larger one of those along rows and columns. Shape (height, width), bool.
    """
    marked = np.zeros(disparity.shape, bool)
    across = np.abs(disparity[:, 1:] - disparity[:, :-1]) > threshold
    down = np.abs(disparity[1:] - disparity[:-1]) > threshold
    for side, steps in (
        (marked[:, 1:], across),
        (marked[:, :-1], across),
        (marked[1:], down),
        (marked[:-1], down),
    ):
        side |= steps
    return dilate(marked, radius)
