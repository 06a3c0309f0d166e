"""How fast disparity changes along a surface, without being fooled by the steps between surfaces."""

import numpy as np


def surface_slope(disparity: np.ndarray, axis: int) -> np.ndarray:
    """Return the change of disparity from pixel to pixel along a surface [px/px], same shape, float32.

    Of the differences to either neighbour the smaller one is taken: at a step, that is the one that
    stays on the surface.

    Args:
        disparity: [px], (height, width), NaN where there is nothing.
        axis: 1: along rows (x); 0: along columns (y).
    """
    if disparity.shape[axis] < 2:
        return np.zeros(disparity.shape, dtype=np.float32)
    steps = np.diff(disparity, axis=axis)
    slope = np.empty(disparity.shape, dtype=np.float32)
    # Views in which the axis comes second.
    steps, view = np.moveaxis(steps, axis, 1), np.moveaxis(slope, axis, 1)
    size = np.abs(steps)
    view[:, :1], view[:, -1:] = steps[:, :1], steps[:, -1:]
    view[:, 1:-1] = np.where(size[:, :-1] < size[:, 1:], steps[:, :-1], steps[:, 1:])
    np.copyto(slope, 0.0, where=np.isnan(slope))
    return slope


def width_ratio(slope: np.ndarray) -> np.ndarray:
    """Return ``|ln(1 - slope)|``: by what factor the eyes differ in the width of a patch, float32.

    A patch one pixel wide on the left is ``1 - slope`` wide on the right, with ``slope`` the change of
    disparity per pixel; from 1 on the right eye sees its back, and the result is inf.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(np.log(1 - slope))
    return np.where(slope >= 1, np.float32(np.inf), ratio)
