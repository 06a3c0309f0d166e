"""How fast disparity changes along a surface, ignoring the steps between surfaces.

The kernels' formulas in NumPy: tests/reference/slopes_twin.py.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

import numpy as np
import warp as wp

from digs_warp.device.contiguous import bytes_from, floats_from
from digs_warp.device.kernel_options import vector_module_options
from digs_warp.sim.sensor.arrays import launch_rows, shared

wp.set_module_options(vector_module_options())

# Only loops of fixed length become vector code: kernels walk a row in pieces of this many pixels, then
# pixel by pixel.
_PIECE = wp.constant(64)


@wp.func
def slope_between(before: float, here: float, after: float) -> float:
    """The smaller of the differences to both neighbors; 0 where it is unknown."""
    back = here - before
    forth = after - here
    slope = wp.where(wp.abs(back) < wp.abs(forth), back, forth)
    return wp.where(slope == slope, slope, 0.0)


@wp.kernel
def _slope_kernel(first: int, disparity: wp.array[float], width: int, slopes: wp.array[float]):
    """Slopes along one row of 2 pixels or more; at the ends the only neighbor counts, whatever its step."""
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
def _steep_kernel(
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
    """Process one row; slopes along columns use the rows above and below."""
    row = first + wp.tid()
    start = row * width
    # In the first and the last row only one neighbor counts: the other is infinitely far away.
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


def surface_slope(disparity: np.ndarray) -> np.ndarray:
    """Return the change of disparity along rows, on the surface [px/px], same shape, float32.

    The smaller of the differences to both neighbors: at a step, that is the one on the same surface. 0 where
    there is none.

    Args:
        disparity: [px], (height, width), float32, NaN where there is nothing.
    """
    height, width = disparity.shape
    if width < 2:
        return np.zeros(disparity.shape, dtype=np.float32)
    slopes = np.empty((height, width), dtype=np.float32)
    launch_rows(_slope_kernel, height, [shared(disparity), width, shared(slopes)])
    return slopes


def steep_pixels(disparity: np.ndarray, slope: np.ndarray, limit: float) -> np.ndarray:
    """Return the flat indices of the pixels whose slope along rows or columns exceeds a limit, (n,).

    Args:
        disparity: [px], (height, width), float32, NaN where there is nothing.
        slope: along rows, as `surface_slope` returns it.
        limit: [px/px], >= 0.
    """
    height, width = disparity.shape
    steep = np.empty((height, width), dtype=np.uint8)
    inputs = [shared(disparity), shared(slope), height, width, limit, shared(steep)]
    launch_rows(_steep_kernel, height, inputs)
    return np.flatnonzero(steep.view(bool))


def slope_along_columns(disparity: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the change of disparity along columns at some pixels, as `surface_slope` does, (n,)."""
    last = len(disparity) - 1
    if last < 1:
        return np.zeros(len(rows), dtype=np.float32)
    here = disparity[rows, columns]
    back = here - disparity[np.maximum(rows - 1, 0), columns]
    forth = disparity[np.minimum(rows + 1, last), columns] - here
    take_back = ((np.abs(back) < np.abs(forth)) | (rows == last)) & (rows > 0)
    slope = np.where(take_back, back, forth)
    return np.where(np.isnan(slope), np.float32(0), slope)


def width_ratio(slope: np.ndarray) -> np.ndarray:
    """Return ``|ln(1 - slope)|``, float32: the logarithm of the ratio of a patch's widths in the two eyes.

    A patch one pixel wide on the left is ``1 - slope`` wide on the right, where ``slope`` is the change of
    disparity per pixel. From a slope of 1 on, the right eye sees its back, and the result is inf.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(np.log(1 - slope))
    return np.where(slope >= 1, np.float32(np.inf), ratio)
