"""Bring depth onto the color camera's pixels."""

import numpy as np

from digs_warp.geometry.camera import Intrinsics, pixel_centers
from digs_warp.geometry.rigid import transform_points

# A pixel of a depth camera covers at most this many columns and rows of the color image, and one more.
LARGEST_SQUARE = 15


def resample_depth(depth: np.ndarray, source: Intrinsics, target: Intrinsics) -> np.ndarray:
    """Return the depth that ``target`` sees, (height, width): the nearest pixel of ``source``, never a mean.

    Both cameras have the same pose, so a ray keeps its planar depth; NaN where
    ``source`` does not look.
    """
    if source == target:
        return depth
    centers = pixel_centers(target.width, target.height)
    u = (centers[..., 0] - target.cx) / target.fx * source.fx + source.cx
    v = (centers[..., 1] - target.cy) / target.fy * source.fy + source.cy
    column, row = np.floor(u).astype(int), np.floor(v).astype(int)
    inside = (column >= 0) & (column < source.width) & (row >= 0) & (row < source.height)
    found = np.full((target.height, target.width), np.nan, np.float32)
    found[inside] = depth[row[inside], column[inside]]
    return found


def register_depth(
    depth: np.ndarray, source: Intrinsics, target: Intrinsics, target_from_source: np.ndarray
) -> np.ndarray:
    """Return the depth that ``target``, a camera in another place, sees of the points of ``source``.

    Each pixel of ``source`` is a square that faces its camera; what is nearest hides the rest.

    Args:
        depth: planar depth [m], (height, width), NaN where unknown.
        source: its camera.
        target: the other camera.
        target_from_source: rigid motion [m], (4, 4).

    Returns:
        Planar depth [m], (height, width), float32; NaN where no point is seen.
    """
    rows, columns = np.nonzero(np.isfinite(depth))
    z = depth[rows, columns].astype(np.float64)
    low, nearness = _projected(columns, rows, z, source, target, target_from_source)
    high, _ = _projected(columns + 1, rows + 1, z, source, target, target_from_source)
    # A square covers the pixels whose centers lie in it, and at least the one in its middle.
    middle = np.floor((low + high) / 2)
    first = np.minimum(np.ceil(low - 0.5), middle)
    last = np.maximum(np.ceil(high - 0.5) - 1, middle)
    seen = (nearness > 0) & np.isfinite(first).all(1) & np.isfinite(last).all(1)
    first, last, nearness = first[seen], last[seen], nearness[seen]
    found = np.full((target.height, target.width), np.inf)
    widest = (last - first).max(axis=0, initial=0).clip(0, LARGEST_SQUARE).astype(int)
    for right in range(widest[0] + 1):
        for down in range(widest[1] + 1):
            place = first + [right, down]
            inside = ((place <= last) & (place >= 0) & (place < [target.width, target.height])).all(
                1
            )
            column, row = place[inside].astype(np.intp).T
            np.minimum.at(found, (row, column), nearness[inside])
    return np.where(np.isfinite(found), found, np.nan).astype(np.float32)


def _projected(
    u: np.ndarray,
    v: np.ndarray,
    z: np.ndarray,
    source: Intrinsics,
    target: Intrinsics,
    target_from_source: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the places (u, v) in ``target``, (n, 2), and depths [m], (n,), of those in ``source``."""
    x, y = (u - source.cx) / source.fx * z, (v - source.cy) / source.fy * z
    moved = transform_points(target_from_source, np.stack([x, y, z], axis=1))
    with np.errstate(divide="ignore", invalid="ignore"):
        places = moved[:, :2] / moved[:, 2:] * [target.fx, target.fy] + [target.cx, target.cy]
    return places, moved[:, 2]
