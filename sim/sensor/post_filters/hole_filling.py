"""The hole filling of librealsense: a hole takes the value of one of its four neighbors.

Written from its documentation (post-processing filters, "Holes Filling filter"). Holes are filled in reading
order, so that filled pixels fill the next ones. Holes with nothing known to the left, above, or right beside
them stay: the left margin, which the right eye does not see.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportIndexIssue=false, reportOperatorIssue=false

from typing import Literal

import numpy as np
import warp as wp

from digs_warp.device.warp_start import start_warp
from digs_warp.sim.sensor.arrays import launch_rows, shared

start_warp()
wp.set_module_options({"enable_backward": False})

Way = Literal["left", "farthest", "nearest"]

# Factor on disparity under which the smallest neighbor is the one wanted.
_SIGN = {"farthest": 1.0, "nearest": -1.0}


@wp.func
def better(at: int, best: int, values: wp.array[float], sign: float) -> int:
    """Return the neighbor that fills a hole rather than the best so far; -1: none."""
    if wp.isnan(values[at]):
        return best
    if best < 0 or sign * values[at] < sign * values[best]:
        return at
    return best


@wp.kernel
def fill_kernel(
    first: int,
    values: wp.array[float],
    source: wp.array[int],
    width: int,
    height: int,
    sign: float,
):
    """Fill the holes of a whole image; ``source`` is the pixel that each value comes from."""
    for row in range(height):
        for column in range(width):
            at = row * width + column
            if wp.isnan(values[at]):
                best = int(-1)
                if column > 0:
                    best = better(at - 1, best, values, sign)
                if row > 0:
                    best = better(at - width, best, values, sign)
                if column < width - 1:
                    best = better(at + 1, best, values, sign)
                if row < height - 1:
                    best = better(at + width, best, values, sign)
                if best >= 0:
                    values[at] = values[best]
                    source[at] = source[best]


def sources_of_holes(disparity: np.ndarray, way: Way = "farthest") -> np.ndarray:
    """Return the flat index of the pixel whose value each pixel takes, (height, width), int32.

    Pixels with a value, and holes that stay, have their own.

    Args:
        disparity: [px], (height, width), float32, NaN where there is none.
        way: from the left neighbor, or from the farthest or nearest of the four that are known.
    """
    height, width = disparity.shape
    own = np.arange(height * width, dtype=np.int32).reshape(height, width)
    if way == "left":
        known = np.where(np.isnan(disparity), -1, own)
        before = np.maximum.accumulate(known, axis=1)
        return np.where(before < 0, own, before)
    source = own.copy()
    values = disparity.astype(np.float32)
    launch_rows(fill_kernel, 1, [shared(values), shared(source), width, height, _SIGN[way]])
    return source
