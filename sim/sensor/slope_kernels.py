"""Kernels that compare each disparity with its neighbours: slopes, steep places and steps, one pass each.

The formulas in NumPy: tests/reference/slopes_twin.py.
"""

# Kernel code is a language of its own; these checks misread it.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

import warp as wp

from digs_warp.device.contiguous import bytes_from, floats_from
from digs_warp.device.kernel_options import vector_module_options
from digs_warp.device.warp_start import start_warp

start_warp()
wp.set_module_options(vector_module_options())

# Only loops of fixed length become vector code: a row is walked in pieces of so many pixels, then one by one.
_PIECE = wp.constant(64)


@wp.func
def slope_between(before: float, here: float, after: float) -> float:
    """The smaller one of the differences to both neighbours; 0 where it is not known."""
    back = here - before
    forth = after - here
    slope = wp.where(wp.abs(back) < wp.abs(forth), back, forth)
    return wp.where(slope == slope, slope, 0.0)


@wp.kernel
def slope_kernel(first: int, disparity: wp.array[float], width: int, slopes: wp.array[float]):
    """Slopes along one row of 2 pixels or more; at the ends the one neighbour counts, whatever its step."""
    start = (first + wp.tid()) * width
    line = floats_from(disparity, start, width)
    out = floats_from(slopes, start, width)
    out[0] = slope_between(line[0] - wp.inf, line[0], line[1])
    out[width - 1] = slope_between(line[width - 2] - wp.inf, line[width - 2], line[width - 1])
    whole = (width - 2) // _PIECE
    for piece in range(whole):
        before = floats_from(disparity, start + piece * _PIECE, _PIECE)
        here = floats_from(disparity, start + piece * _PIECE + 1, _PIECE)
        after = floats_from(disparity, start + piece * _PIECE + 2, _PIECE)
        slope = floats_from(slopes, start + piece * _PIECE + 1, _PIECE)
        for x in range(_PIECE):
            slope[x] = slope_between(before[x], here[x], after[x])
    for i in range(whole * _PIECE + 1, width - 1):
        out[i] = slope_between(line[i - 1], line[i], line[i + 1])


@wp.kernel
def steep_kernel(
    first: int,
    disparity: wp.array[float],  # [height * width]
    slopes: wp.array[float],  # [height * width] along rows
    height: int,
    width: int,
    limit: float,
    # outputs
    steep: wp.array[
        wp.uint8
    ],  # [height * width] 1 where a slope along rows or columns exceeds the limit
):
    """Go through one row; its slopes along columns are those to the rows above and below."""
    row = first + wp.tid()
    start = row * width
    # In the first and the last row the one neighbour counts: the other is infinitely far away.
    middle = wp.where(row == height - 1, wp.max(height - 2, 0), row)
    at_end = height > 1 and (row == 0 or row == height - 1)
    away = wp.where(at_end, wp.inf, 0.0)
    above = wp.max(middle - 1, 0) * width
    below = wp.min(middle + 1, height - 1) * width
    middle = middle * width
    whole = width // _PIECE
    for piece in range(whole):
        column = piece * _PIECE
        before = floats_from(disparity, above + column, _PIECE)
        here = floats_from(disparity, middle + column, _PIECE)
        after = floats_from(disparity, below + column, _PIECE)
        along = floats_from(slopes, start + column, _PIECE)
        out = bytes_from(steep, start + column, _PIECE)
        for x in range(_PIECE):
            across = slope_between(before[x] - away, here[x], after[x])
            out[x] = wp.uint8(wp.where(wp.max(wp.abs(along[x]), wp.abs(across)) > limit, 1, 0))
    for i in range(whole * _PIECE, width):
        over = slope_between(
            disparity[above + i] - away, disparity[middle + i], disparity[below + i]
        )
        found = wp.max(wp.abs(slopes[start + i]), wp.abs(over)) > limit
        steep[start + i] = wp.uint8(wp.where(found, 1, 0))


@wp.kernel
def step_kernel(
    first: int,
    disparity: wp.array[float],  # [height * width]
    height: int,
    width: int,
    threshold: float,
    # outputs
    steps: wp.array[wp.uint8],  # [height * width] 1 where disparity jumps to the right or downward
):
    """Go through one row."""
    row = first + wp.tid()
    start = row * width
    below = start + wp.where(row < height - 1, width, 0)
    whole = (width - 1) // _PIECE
    for piece in range(whole):
        column = start + piece * _PIECE
        here = floats_from(disparity, column, _PIECE)
        right = floats_from(disparity, column + 1, _PIECE)
        under = floats_from(disparity, below + piece * _PIECE, _PIECE)
        out = bytes_from(steps, column, _PIECE)
        for x in range(_PIECE):
            # One after the other: the maximum of a jump and of one to a missing value may be either.
            sideways = wp.where(wp.abs(right[x] - here[x]) > threshold, 1, 0)
            downward = wp.where(wp.abs(under[x] - here[x]) > threshold, 1, 0)
            out[x] = wp.uint8(wp.max(sideways, downward))
    for i in range(whole * _PIECE, width):
        own = disparity[start + i]
        found = wp.where(wp.abs(disparity[below + i] - own) > threshold, 1, 0)
        if i < width - 1:
            found = wp.max(
                found, wp.where(wp.abs(disparity[start + i + 1] - own) > threshold, 1, 0)
            )
        steps[start + i] = wp.uint8(found)
