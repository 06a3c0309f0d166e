"""What the right eye cannot see: decided from disparity where that is safe, by rays elsewhere.

Only one direction is safe: a closed surface that both eyes see covers what lands behind it. The opposite is
not: sides of objects that the left eye does not see hide points, too.

The kernel's formulas point by point: tests/reference/right_eye_twin.py.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

import numpy as np
import warp as wp

from digs_warp.device.kernel_options import vector_module_options
from digs_warp.device.warp_start import start_warp
from digs_warp.sim.sensor.arrays import launch_rows, shared

start_warp()
wp.set_module_options(vector_module_options())

# The classes of `classify`.
SEEN, UNSURE, HIDDEN = wp.constant(0), wp.constant(1), wp.constant(2)

# An edge may lie anywhere between two pixel centers. Half a pixel finds 99.5 % of the hidden pixels, and
# sends 4 to 10 % of all pixels of the sample meshes to the rays.
BETWEEN_PIXELS = 0.5

# A surface hides a point for certain if it is nearer by this much and steps less from pixel to pixel [px].
NEARER = 1.0


_NOWHERE = wp.constant(1e30)
_NOBODY = wp.constant(wp.uint8(0))  # asks for the pixel
_BETWEEN_PIXELS, _NEARER = wp.constant(BETWEEN_PIXELS), wp.constant(NEARER)


@wp.kernel
def _classify_kernel(
    first: int,
    width: int,
    disparity: wp.array[float],
    opaque: wp.array[float],
    where: wp.array[wp.uint8],
    # outputs
    nearest: wp.array[float],  # the row of the right image
    state: wp.array[wp.uint8],
):
    """Process one row. The rows of a launch share the row of the right image."""
    begin = (first + wp.tid()) * width
    # From right to left: a point that lands right of one further right in the left image may be hidden by it.
    leftmost = float(_NOWHERE)  # where points have landed so far
    least = float(_NOWHERE)  # disparity of those that may be hidden
    for i in range(width):
        x = width - 1 - i
        own = disparity[begin + x]
        landing = float(x) - own  # NaN where nothing is: no comparison holds
        may_be = (
            leftmost < landing + _BETWEEN_PIXELS and landing >= -0.5 and where[begin + x] != _NOBODY
        )
        state[begin + x] = wp.uint8(wp.where(may_be, UNSURE, SEEN))
        if may_be:
            least = wp.min(least, own)
        if landing < leftmost:
            leftmost = landing
    if least == _NOWHERE or width < 3:
        return
    # The nearest opaque point that lands at each place of the right image. Of points that land together, the
    # rightmost one is the nearest, and is written last. What can hide none is left out.
    for i in range(width):
        nearest[i] = wp.nan
    for i in range(width):
        own = opaque[begin + i]
        if own > least + _NEARER and own <= float(i):
            nearest[int(float(i) - own)] = own
    for i in range(width):
        if state[begin + i] == wp.uint8(UNSURE):
            own = disparity[begin + i]
            middle = wp.clamp(int(float(i) - own), 1, width - 2)
            left, here, right = nearest[middle - 1], nearest[middle], nearest[middle + 1]
            # Nearer on both sides, without a step between: no gap to look through.
            closed = wp.abs(left - here) < _NEARER and wp.abs(right - here) < _NEARER
            if closed and wp.min(wp.min(left, here), right) > own + _NEARER:
                state[begin + i] = wp.uint8(HIDDEN)


def classify(disparity: np.ndarray, opaque: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Return SEEN, UNSURE or HIDDEN for each pixel: whether the right eye sees it, (height, width), uint8.

    Whatever hides a point from the right eye appears in the left image to the right of the point, and lands
    in the right image at the same place or to the left of it: an object in the triangle between both eyes
    and the point is seen by the left eye to the right of the point. If there is no such object, the point
    is seen. It is hidden for certain if a closed, nearer surface covers it. Points that land outside the
    right image count as seen: that is the invalid band, not occlusion.

    Args:
        disparity: [px], (height, width), float32, NaN where there is nothing.
        opaque: the same, without transparent surfaces.
        where: the pixels in question, (height, width), bool; the others are SEEN.
    """
    height, width = disparity.shape
    images = [shared(np.asarray(image, np.float32)) for image in (disparity, opaque)]
    images.append(shared(np.ascontiguousarray(where).view(np.uint8)))
    scratch = wp.empty(width, dtype=float, device="cpu")
    state = np.empty((height, width), np.uint8)
    launch_rows(_classify_kernel, height, [width, *images, scratch, shared(state)])
    return state
