"""Float64 twin of `digs_warp.poses.refine.alignment_kernel`: one pair of views at a time, in NumPy."""

import numpy as np
from scipy.ndimage import map_coordinates

from digs_warp.geometry.rigid import transform_points
from digs_warp.poses.refine.photometric_alignment import Scales
from digs_warp.poses.views import View


def pair_equations(
    source: View, target: View, target_from_source: np.ndarray, scales: Scales, hidden: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrix (6, 6) and the right side (6,)."""
    k = target.picture.intrinsics
    middle = transform_points(target_from_source, source.points.astype(np.float64))
    row = k.fy * middle[:, 1] / middle[:, 2] + k.cy
    moment = (row / k.height - 0.5)[:, None]
    q = middle - moment * (np.cross(target.picture.turn, middle) + target.picture.shift)
    u, v = k.fx * q[:, 0] / q[:, 2] + k.cx, k.fy * q[:, 1] / q[:, 2] + k.cy
    inside = (q[:, 2] > 0) & (u >= 2) & (v >= 2) & (u <= k.width - 2) & (v <= k.height - 2)
    q, u, v, values = q[inside], u[inside], v[inside], source.values[inside].astype(np.float64)
    depth = target.picture.depth
    z, measured = q[:, 2], bilinear(depth, u, v)
    seen = np.abs(z - measured) / z < hidden
    q, u, v, z, measured, values = (each[seen] for each in (q, u, v, z, measured, values))
    du, dv = _flow(target, q)
    of_color = color_slope(target, q, u, v)
    color = bilinear(target.image, u, v) - values
    depth_slope = -_slope(depth, u, v, du, dv) / measured[:, None] ** 2
    inverse_slope = np.outer(1 / z**2, [0, 0, 1]) + depth_slope
    matrix, side = np.zeros((6, 6)), np.zeros(6)
    for slope, error, scale in (
        (of_color, color, scales.color),
        (inverse_slope, 1 / measured - 1 / z, scales.depth),
    ):
        known = np.isfinite(slope).all(axis=1)
        weight = np.where(known, 1 / (scale**2 + error**2), 0)
        rows = np.nan_to_num(np.concatenate([np.cross(q, slope), slope], axis=1))
        matrix += (rows * weight[:, None]).T @ rows
        side -= rows.T @ (weight * error)
    return matrix, side


def color_slope(target: View, q: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return how the image at points q, seen at (u, v), changes per motion of each, (n, 3)."""
    return _slope(target.image, u, v, *_flow(target, q))


def _flow(target: View, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how far the pixels of points move to the right and down per motion of each, (n, 3)."""
    k, z = target.picture.intrinsics, q[:, 2]
    zero = np.zeros_like(z)
    du = np.stack([k.fx / z, zero, -k.fx * q[:, 0] / z**2], axis=1)
    dv = np.stack([zero, k.fy / z, -k.fy * q[:, 1] / z**2], axis=1)
    return du, dv


def _slope(
    plane: np.ndarray, u: np.ndarray, v: np.ndarray, du: np.ndarray, dv: np.ndarray
) -> np.ndarray:
    across = bilinear(plane, u + 0.5, v) - bilinear(plane, u - 0.5, v)
    down = bilinear(plane, u, v + 0.5) - bilinear(plane, u, v - 0.5)
    return across[:, None] * du + down[:, None] * dv


def bilinear(plane: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the values of a plane at pixels."""
    return map_coordinates(plane.astype(np.float64), [v - 0.5, u - 0.5], order=1, mode="nearest")
