"""Where a reflected object appears to be: the depth that matching a reflection gives."""

import numpy as np

from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.steps import pixels_where

# Concave mirrors can move the image to infinity or in front of the surface; this limits it [m].
MAX_VIRTUAL_DISTANCE = 100.0

# Neighbors whose depth differs by more than this share belong to different surfaces.
SAME_SURFACE = 0.05


def virtual_disparity(truth: FrameTruth, where: np.ndarray) -> np.ndarray:
    """Return the disparity [px] of what the surface reflects, (height, width), float64.

    Both eyes see the reflected object behind the surface. A flat mirror shows it as far behind as it lies
    in front; a curved one at v, where 1/v = 1/s + 2k (the mirror equation), s is the distance of the object
    and k the curvature of the surface along the baseline [1/m], positive where convex.

    Args:
        truth: its rays give the distance of the reflected object.
        where: pixels to compute, (height, width), bool; the others are NaN.
    """
    rows, columns = pixels_where(where)
    k = truth.camera.intrinsics
    depth = truth.depth[rows, columns].astype(np.float64)
    x, y = (columns + 0.5 - k.cx) / k.fx, (rows + 0.5 - k.cy) / k.fy
    to_surface = depth * np.sqrt(1 + x * x + y * y)
    to_mirrored = truth.rays.reflection_distance(where)[rows, columns].astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / to_mirrored + 2 * curvature_along_rows(truth, rows, columns)
        behind = 1 / np.maximum(inverse, 1 / MAX_VIRTUAL_DISTANCE)
        virtual_depth = depth * (to_surface + behind) / to_surface
    disparity = np.full(where.shape, np.nan)
    disparity[rows, columns] = truth.rig.intrinsics.fx * truth.rig.baseline / virtual_depth
    return disparity


def curvature_along_rows(truth: FrameTruth, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the curvature of the surface along the rows [1/m] at some pixels, shape (n,).

    Positive where convex (a sphere of radius r seen from outside: 1/r). Measured between the neighbors on
    the same surface; 0 if there are none.
    """
    last = truth.depth.shape[1] - 1
    left, right = (
        np.where(_same_surface(truth, rows, columns, side), side, columns)
        for side in (np.maximum(columns - 1, 0), np.minimum(columns + 1, last))
    )
    start, end = (
        truth.camera.unproject(
            np.stack([side + 0.5, rows + 0.5], axis=-1), truth.depth[rows, side].astype(np.float64)
        )
        for side in (left, right)
    )
    step = end - start
    turn = truth.normals_world[rows, right].astype(np.float64) - truth.normals_world[rows, left]
    length = np.sum(step * step, axis=1)
    return np.where(left < right, np.sum(turn * step, axis=1) / np.maximum(length, 1e-12), 0.0)


def _same_surface(
    truth: FrameTruth, rows: np.ndarray, columns: np.ndarray, others: np.ndarray
) -> np.ndarray:
    """Return whether pixels show the same surface as other pixels of their rows, shape (n,), bool."""
    depth = truth.depth[rows, columns]
    same_material = truth.material_ids[rows, others] == truth.material_ids[rows, columns]
    return same_material & (np.abs(truth.depth[rows, others] - depth) < SAME_SURFACE * depth)
