"""How well details of two frames match where a motion lays them over each other; exposure does not count."""

import numpy as np

from digs_warp.geometry.reproject import compare_depth, project
from digs_warp.geometry.rigid import invert_rigid, transform_points
from digs_warp.poses.views import Picture, View

# Fewer points than this, or a smaller share of a frame's points, tell nothing.
FEWEST, SMALLEST_SHARE = 100, 0.05


def correlation(first: View, second: View, second_from_first: np.ndarray) -> float:
    """Return the correlation of brightness, less its mean nearby and over its contrast, -1 to 1.

    Over the points of a frame where the other measures the same depth, the smaller of both directions; 0 if
    there are few. Right motions have much of it in any light, where walls have any texture at all; wrong ones
    have little, unless the texture repeats.

    Args:
        first: a frame.
        second: another.
        second_from_first: the motion, (4, 4).
    """
    there = _one_way(first, second, second_from_first)
    return min(there, _one_way(second, first, invert_rigid(second_from_first)))


def _one_way(view: View, other: View, motion: np.ndarray) -> float:
    k = other.picture.intrinsics
    moved = transform_points(motion, view.points.astype(np.float64))
    u, v, z = project(_when_read(moved, other.picture), k)
    u, v = u - 0.5, v - 0.5  # whole ones at the centers of pixels
    inside = (z > 0) & (u >= 0) & (u < k.width - 1) & (v >= 0) & (v < k.height - 1)
    u, v, z, values = u[inside], v[inside], z[inside], view.values[inside]
    measured = other.picture.depth[np.rint(v).astype(np.intp), np.rint(u).astype(np.intp)]
    same = compare_depth(z, measured).agrees
    if np.count_nonzero(same) < max(FEWEST, SMALLEST_SHARE * len(view.points)):
        return 0.0
    seen, expected = _between_pixels(other.image, u[same], v[same]), values[same].astype(np.float64)
    seen, expected = seen - seen.mean(), expected - expected.mean()
    lengths = np.linalg.norm(seen) * np.linalg.norm(expected)
    return float(seen @ expected / lengths) if lengths > 0 else 0.0


def _when_read(points: np.ndarray, picture: Picture) -> np.ndarray:
    """Return the points in the axes that the camera has when it reads their rows, (n, 3)."""
    _, row, depth = project(points, picture.intrinsics)
    moment = np.where(depth > 0, row / picture.intrinsics.height - 0.5, 0.0)[:, None]
    return points - moment * (np.cross(picture.turn, points) + picture.shift)


def _between_pixels(image: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return bilinear values; whole u and v are centers of pixels."""
    column, row = u.astype(np.intp), v.astype(np.intp)
    right, down = u - column, v - row
    top = image[row, column] * (1 - right) + image[row, column + 1] * right
    below = image[row + 1, column] * (1 - right) + image[row + 1, column + 1] * right
    return top * (1 - down) + below * down
