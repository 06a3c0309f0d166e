"""Float64 twin of `bundle_adjustment`: motions and distances in one dense system, nothing eliminated."""

from collections.abc import Sequence

import numpy as np

from digs_warp.geometry.rigid import invert_rigid, transform_points
from digs_warp.poses.views import View
from reference.pair_twin import bilinear, color_slope


def joint_step(
    views: Sequence[View],
    pairs: np.ndarray,
    poses: np.ndarray,
    color: float,
    hidden: float,
    trust: np.ndarray,
    moved: np.ndarray,
    damping: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return one Gauss-Newton step: motions (n, 6), and logarithms of nearness of all m points, (m,).

    ``pairs``: (source, target), (k, 2); ``color``: residual that counts half; ``hidden``: relative difference
    of depth from which on another surface is seen; ``trust``: inverse variance of a motion, (6,), 1 of the
    nearness; ``moved``: of each camera from where it is expected, (n, 6); ``damping``: share of the
    motions' diagonal that is added, after the distances are eliminated.
    """
    starts = np.cumsum([0, *(len(view.points) for view in views)])
    cameras = 6 * len(views)
    total = cameras + int(starts[-1])
    matrix, side = np.zeros((total, total)), np.zeros(total)
    matrix[range(cameras, total), range(cameras, total)] = 1.0
    for i, j in pairs:
        point, residual, slopes, nearer = _residuals(views[i], views[j], poses[i], poses[j], hidden)
        weight = 1 / (color**2 + residual**2)
        rows = np.zeros((len(point), total))
        rows[:, 6 * i : 6 * i + 6], rows[:, 6 * j : 6 * j + 6] = slopes
        rows[range(len(point)), cameras + starts[i] + point] = nearer
        matrix += rows.T @ (weight[:, None] * rows)
        side -= rows.T @ (weight * residual)
    # What is left for the motions once every distance follows them.
    across = matrix[:cameras, cameras:] / np.diag(matrix)[cameras:]
    left = matrix[:cameras, :cameras] - across @ matrix[cameras:, :cameras]
    left[range(cameras), range(cameras)] += damping * np.diag(left) + np.tile(trust, len(views))
    right = side[:cameras] - across @ side[cameras:] - (trust * moved).reshape(-1)
    motions = np.linalg.solve(left, right)
    nearer = (side[cameras:] - matrix[cameras:, :cameras] @ motions) / np.diag(matrix)[cameras:]
    return motions.reshape(-1, 6), nearer


def _residuals(
    source: View, target: View, source_pose: np.ndarray, target_pose: np.ndarray, hidden: float
) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Return numbers of the points that are seen, residuals, slopes per both motions, and per nearness.

    The slopes along the motions are differences: of where the points are after small motions of each camera.
    """
    k = target.picture.intrinsics
    relative = invert_rigid(target_pose) @ source_pose
    points = source.points.astype(np.float64)
    q = _at_its_row(transform_points(relative, points), target)
    u, v = k.fx * q[:, 0] / q[:, 2] + k.cx, k.fy * q[:, 1] / q[:, 2] + k.cy
    inside = (q[:, 2] > 0) & (u >= 2) & (v >= 2) & (u <= k.width - 2) & (v <= k.height - 2)
    safe_u, safe_v = np.where(inside, u, 10.0), np.where(inside, v, 10.0)
    measured = bilinear(target.picture.depth, safe_u, safe_v)
    seen = np.flatnonzero(inside & (np.abs(q[:, 2] - measured) / q[:, 2] < hidden))
    q, u, v, points = q[seen], u[seen], v[seen], points[seen]
    residual = bilinear(target.image, u, v) - source.values[seen].astype(np.float64)
    slope = color_slope(target, q, u, v)

    def along(motion: np.ndarray) -> np.ndarray:
        """Return the slope of the residual where a motion of the points (turn, shift) is taken."""
        return np.einsum("pi,pi->p", slope, np.cross(motion[:3], q) + motion[3:])

    # The target's own motion (w, t) moves what it sees by -(t + w x q).
    of_target = -np.stack([along(axis) for axis in np.eye(6)], axis=1)
    carried = np.zeros((6, 6))
    for axis in range(3):
        turn = relative[:3, axis]
        carried[axis, :3], carried[axis, 3:] = turn, np.cross(relative[:3, 3], turn)
        carried[3 + axis, 3:] = turn
    of_source = np.stack([along(axis) for axis in carried], axis=1)
    nearer = -np.einsum("pi,pi->p", slope, points @ relative[:3, :3].T)
    return seen, residual, (of_source, of_target), nearer


def _at_its_row(middle: np.ndarray, target: View) -> np.ndarray:
    k = target.picture.intrinsics
    moment = ((k.fy * middle[:, 1] / middle[:, 2] + k.cy) / k.height - 0.5)[:, None]
    return middle - moment * (np.cross(target.picture.turn, middle) + target.picture.shift)
