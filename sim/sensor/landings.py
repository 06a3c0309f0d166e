"""Where the points of the left image land in the right one, and what covers them there: one pass per row.

NumPy needs a dozen passes over the image for the same; see tests/reference/right_eye_twin.py.
"""

# Kernel code is a language of its own; these checks misread it.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

import numpy as np
import warp as wp

from digs_warp.parallel import launch_parallel
from digs_warp.warp_start import start_warp

start_warp()
wp.set_module_options({"enable_backward": False})

# What `classify` tells of a pixel.
SEEN = wp.constant(0)
UNSURE = wp.constant(1)
HIDDEN = wp.constant(2)

# An edge may lie anywhere between two pixel centres; half a pixel finds 99.5 % of what is hidden, among 4 to
# 10 % of the pixels of the sample meshes.
BETWEEN_PIXELS = wp.constant(0.5)

# What hides a point for sure is nearer by this much, and steps less from pixel to pixel [px].
NEARER = wp.constant(1.0)

NOTHING = wp.constant(float("nan"))


@wp.kernel
def _classify_kernel(
    first: int,
    disparity: wp.array2d[float],
    opaque: wp.array2d[float],
    # outputs
    nearest: wp.array2d[
        float
    ],  # right image: disparity of the nearest point that lands there; NaN: none
    state: wp.array2d[wp.uint8],
):
    """Land a row of the left image in the right one, then ask for each point what else landed there."""
    row = first + wp.tid()
    width = disparity.shape[1]
    for i in range(width):
        nearest[row, i] = NOTHING
    for i in range(width):
        landing = float(i) - opaque[row, i]
        if landing >= 0.0:
            # Of points that land together the one further right is nearer, and is written last.
            nearest[row, int(landing)] = opaque[row, i]
    leftmost_to_come = wp.float32(1.0e30)
    for i in range(width):
        column = width - 1 - i
        own = disparity[row, column]
        landing = float(column) - own
        found = wp.uint8(SEEN)
        if leftmost_to_come < landing + BETWEEN_PIXELS and landing >= -0.5:
            found = wp.uint8(UNSURE)
            middle = wp.clamp(int(landing), 1, width - 2)
            if width >= 3:
                left = nearest[row, middle - 1]
                here = nearest[row, middle]
                right = nearest[row, middle + 1]
                # Something on both sides, nearer, and without a step between: no gap to look through.
                closed = wp.abs(left - here) < NEARER and wp.abs(right - here) < NEARER
                if closed and wp.min(wp.min(left, here), right) > own + NEARER:
                    found = wp.uint8(HIDDEN)
        state[row, column] = found
        if landing < leftmost_to_come:
            leftmost_to_come = landing


def classify(disparity: np.ndarray, opaque: np.ndarray) -> np.ndarray:
    """Return SEEN, UNSURE or HIDDEN for each pixel: whether the right eye sees it, (height, width), uint8.

    What hides a point from the right eye shows in the left image, further right, and lands in the right
    image at the same place or left of it. (Something in the triangle between both eyes and the point is
    seen by the left eye to the right of the point.) Where nothing does, the point is seen. It is hidden
    for sure where a closed, nearer surface covers it. Points that land outside the right image count as
    seen: that is the invalid band, not occlusion.

    Args:
        disparity: [px], (height, width), float32, NaN where there is nothing.
        opaque: the same without what can be seen through.
    """
    height, width = disparity.shape
    inputs = [
        wp.from_numpy(np.ascontiguousarray(image, np.float32), dtype=float, device="cpu")
        for image in (disparity, opaque)
    ]
    nearest = wp.empty((height, width), dtype=float, device="cpu")
    state = wp.empty((height, width), dtype=wp.uint8, device="cpu")
    launch_parallel(_classify_kernel, height, [*inputs, nearest, state])
    return state.numpy()
