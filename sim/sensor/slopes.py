"""How fast disparity changes along a surface, without being fooled by the steps between surfaces."""

import numpy as np

from digs_warp.sim.sensor.arrays import launch_rows, shared
from digs_warp.sim.sensor.slope_kernels import slope_kernel, steep_kernel


def surface_slope(disparity: np.ndarray) -> np.ndarray:
    """Return the change of disparity along rows, on the surface [px/px], same shape, float32.

    Of the differences to either neighbour the smaller one is taken: at a step, that is the one that
    stays on the surface. 0 where there is none.

    Args:
        disparity: [px], (height, width), float32, NaN where there is nothing.
    """
    height, width = disparity.shape
    if width < 2:
        return np.zeros(disparity.shape, dtype=np.float32)
    slopes = np.empty((height, width), dtype=np.float32)
    launch_rows(slope_kernel, height, [shared(disparity), width, shared(slopes)])
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
    launch_rows(steep_kernel, height, inputs)
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
    """Return ``|ln(1 - slope)|``: by what factor the eyes differ in the width of a patch, float32.

    A patch one pixel wide on the left is ``1 - slope`` wide on the right, with ``slope`` the change of
    disparity per pixel; from 1 on the right eye sees its back, and the result is inf.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(np.log(1 - slope))
    return np.where(slope >= 1, np.float32(np.inf), ratio)
