"""How firmly what two frames share holds the motion between them, in the form of Open3D's pose graphs."""

import numpy as np

from digs_warp.geometry.reproject import SAME_SURFACE, DepthTolerance, compare_depth, reproject
from digs_warp.poses.views import Picture, View

# Farther than this many usual distances, depth is too noisy to place a camera.
FARTHEST = 3.0


def usual_distance(picture: Picture) -> float:
    """Return the harmonic mean of the depth [m]: near things place a camera best."""
    return float(1 / np.nanmean(1 / picture.depth))


def information(first: View, second: View, second_from_first: np.ndarray) -> np.ndarray:
    """Return the information of a motion, (6, 6), rotation first: each point on the same surface counts 1.

    A small motion (w, t) moves a point q, in the axes of the second frame, by w x q + t (Choi et al., "Robust
    reconstruction of indoor scenes", CVPR 2015, section 4).
    """
    other, near = second.picture, usual_distance(first.picture)
    seen = reproject(first.points.astype(np.float64), second_from_first, other.intrinsics)
    tolerance = DepthTolerance(0.0, SAME_SURFACE.relative * near)
    same = compare_depth(seen.depth, other.depth[seen.rows, seen.columns], tolerance).agrees
    x, y, z = seen.points[seen.inside & same & (seen.depth < FARTHEST * near)].T
    zero, one = np.zeros_like(z), np.ones_like(z)
    moves = np.array(
        [
            [zero, z, -y, one, zero, zero],
            [-z, zero, x, zero, one, zero],
            [y, -x, zero, zero, zero, one],
        ]
    )
    # Nothing is held by less than by one point at a distance of 1 m.
    return np.eye(6) + np.einsum("rin,rjn->ij", moves, moves)
