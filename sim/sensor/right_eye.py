"""What the right eye cannot see: decided from disparity where that is safe, by rays elsewhere.

Only one direction is safe: a closed surface that both eyes see covers what lands behind it. The opposite is
not: sides of objects that the left eye does not see hide points, too.

One pass per row finds where the points of the left image land in the right one, and what covers them there.
NumPy needs a dozen passes over the image; see tests/reference/right_eye_twin.py.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

from collections.abc import Callable

import numpy as np
import warp as wp

from digs_warp.device.contiguous import bytes_from, floats_from
from digs_warp.device.kernel_options import vector_module_options
from digs_warp.device.parallel import launch_parallel
from digs_warp.device.warp_start import start_warp

start_warp()
wp.set_module_options(vector_module_options())

# The classes of `classify`.
SEEN = wp.constant(0)
UNSURE = wp.constant(1)
HIDDEN = wp.constant(2)

# An edge may lie anywhere between two pixel centers. Half a pixel finds 99.5 % of the hidden pixels, and
# sends 4 to 10 % of all pixels of the sample meshes to the rays.
BETWEEN_PIXELS = wp.constant(0.5)

# A surface hides a point for certain if it is nearer by this much and steps less from pixel to pixel [px].
NEARER = wp.constant(1.0)

# A row that has landed serves queries this much farther away, too [px].
REACH = wp.constant(2.0)

NOTHING = wp.constant(float("nan"))

# Blocks of this many pixels are skipped if none of them can be hidden: most of an image.
_BLOCK = wp.constant(32)


@wp.func
def steps_that_may_hide(here: wp.array[float], right: wp.array[float]) -> int:
    """Count the pixels of a block whose right neighbor does not land at least half a pixel to the right."""
    count = int(0)
    for x in range(_BLOCK):
        apart = 1.0 + here[x] - right[x]
        count += wp.where(apart >= BETWEEN_PIXELS, 0, 1)
    return count


@wp.func
def nearer_than(disparity: wp.array[float], limit: float) -> int:
    """Count the pixels of a block whose disparity exceeds the limit."""
    count = int(0)
    for x in range(_BLOCK):
        count += wp.where(disparity[x] > limit, 1, 0)
    return count


@wp.func
def land(opaque: wp.array[float], start: int, width: int, limit: float, nearest: wp.array[float]):
    """Fill a row of the right image with the disparity of the nearest point that lands there; NaN: none.

    Points whose disparity does not exceed the limit may be skipped: they hide nothing that matters.
    """
    whole = width // _BLOCK
    for cleared in range(whole):
        part = floats_from(nearest, cleared * _BLOCK, _BLOCK)
        for x in range(_BLOCK):
            part[x] = NOTHING
    for i in range(whole * _BLOCK, width):
        nearest[i] = NOTHING
    for block in range(whole + 1):
        begin = block * _BLOCK
        count = wp.min(_BLOCK, width - begin)
        points = floats_from(opaque, start + begin, count)
        matters = bool(True)
        if count == _BLOCK:
            matters = nearer_than(points, limit) > 0
        if matters:
            for j in range(count):
                place = float(begin + j) - points[j]
                if place >= 0.0:
                    # Of points that land together, the rightmost one is the nearest, and is written last.
                    nearest[int(place)] = points[j]


@wp.func
def is_covered(nearest: wp.array[float], landing: float, own: float, width: int) -> bool:
    """Whether a closed, nearer surface lands where a point of disparity ``own`` does."""
    if width < 3:
        return False
    middle = wp.clamp(int(landing), 1, width - 2)
    left = nearest[middle - 1]
    here = nearest[middle]
    right = nearest[middle + 1]
    # Nearer on both sides, without a step between: no gap to look through.
    closed = wp.abs(left - here) < NEARER and wp.abs(right - here) < NEARER
    return closed and wp.min(wp.min(left, here), right) > own + NEARER


@wp.kernel
def _classify_kernel(
    first: int,
    width: int,
    disparity: wp.array[float],
    opaque: wp.array[float],
    # outputs
    nearest: wp.array[float],  # scratch: the right image
    state: wp.array[wp.uint8],
):
    """Walk a row from right to left; a point that lands to the right of a nearer one may be hidden by it."""
    start = (first + wp.tid()) * width
    own = floats_from(disparity, start, width)
    # The rows of a launch run one after another and share the scratch memory of the first one.
    landed = floats_from(nearest, first * width, width)
    found = bytes_from(state, start, width)
    # The right image holds all points nearer than this.
    landed_limit = wp.float32(1.0e30)
    leftmost_to_come = wp.float32(1.0e30)
    end = int(width)
    while end > 0:
        begin = wp.max(end - _BLOCK, 0)
        last = float(end - 1) - own[end - 1]
        in_order = bool(False)
        if end < width and end - begin == _BLOCK and leftmost_to_come >= last + BETWEEN_PIXELS:
            here = floats_from(disparity, start + begin, _BLOCK)
            right = floats_from(disparity, start + begin + 1, _BLOCK)
            in_order = steps_that_may_hide(here, right) == 0
        block = bytes_from(state, start + begin, _BLOCK)
        if end - begin == _BLOCK:
            for x in range(_BLOCK):
                block[x] = wp.uint8(SEEN)
        else:
            for i in range(end - begin):
                found[begin + i] = wp.uint8(SEEN)
        if in_order:
            leftmost_to_come = wp.min(leftmost_to_come, float(begin) - own[begin])
        else:
            for back in range(end - begin):
                column = end - 1 - back
                landing = float(column) - own[column]
                if leftmost_to_come < landing + BETWEEN_PIXELS and landing >= -0.5:
                    if own[column] + NEARER < landed_limit:
                        landed_limit = own[column] + NEARER - REACH
                        land(opaque, start, width, landed_limit, landed)
                    hidden = is_covered(landed, landing, own[column], width)
                    found[column] = wp.uint8(wp.where(hidden, HIDDEN, UNSURE))
                if landing < leftmost_to_come:
                    leftmost_to_come = landing
        end = begin


def classify(disparity: np.ndarray, opaque: np.ndarray) -> np.ndarray:
    """Return SEEN, UNSURE or HIDDEN for each pixel: whether the right eye sees it, (height, width), uint8.

    Whatever hides a point from the right eye appears in the left image to the right of the point, and lands
    in the right image at the same place or to the left of it: an object in the triangle between both eyes
    and the point is seen by the left eye to the right of the point. If there is no such object, the point
    is seen. It is hidden for certain if a closed, nearer surface covers it. Points that land outside the
    right image count as seen: that is the invalid band, not occlusion.

    Args:
        disparity: [px], (height, width), float32, NaN where there is nothing.
        opaque: the same, without transparent surfaces.
    """
    height, width = disparity.shape
    inputs = [
        wp.from_numpy(
            np.ascontiguousarray(image, np.float32).reshape(-1), dtype=float, device="cpu"
        )
        for image in (disparity, opaque)
    ]
    nearest = wp.empty(height * width, dtype=float, device="cpu")
    state = wp.empty(height * width, dtype=wp.uint8, device="cpu")
    launch_parallel(_classify_kernel, height, [width, *inputs, nearest, state])
    return state.numpy().reshape(height, width)


def hidden_from_right(
    disparity: np.ndarray,
    opaque: np.ndarray,
    where: np.ndarray,
    right_visibility: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    """Return which pixels of ``where`` an opaque surface hides from the right eye, (height, width), bool.

    Points that land outside the right image do not count: that is the invalid band, not occlusion.

    Args:
        disparity: [px], (height, width), NaN where there is nothing.
        opaque: the same, without transparent surfaces.
        where: the pixels in question, (height, width), bool.
        right_visibility: casts rays to find whether the right eye sees the pixels of a mask, both
            (height, width), bool; see `digs_warp.sim.sensor.frame.FrameRays`.
    """
    state = classify(disparity, opaque)
    hidden, unsure = where & (state == HIDDEN), where & (state == UNSURE)
    if unsure.any():
        hidden |= unsure & ~right_visibility(unsure)
    return hidden
