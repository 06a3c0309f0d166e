"""Which frames see the same surface from directions that are not too different."""

from collections.abc import Sequence

import numpy as np

from digs_warp.camera import Camera, pixel_centers
from digs_warp.poses.views import Picture

# Frames that each frame is compared with, at least; some are chosen by others as well.
NEIGHBORS = 8
# Directions that differ by more see too different a picture [degree].
WIDEST_ANGLE = 54.0
# Less in common than this share says too little.
LEAST_SHARED = 0.05
# The other frame has to measure a point's depth to this share: it may be off by the error of the poses.
SAME_DEPTH = 0.1
# Points looked at in each frame.
SAMPLES = 1000


def overlapping_pairs(pictures: Sequence[Picture], poses: np.ndarray) -> np.ndarray:
    """Return pairs (source, target) in both directions, (k, 2), sorted; none for frames without depth.

    Args:
        pictures: of n frames.
        poses: ``world_from_cam``, (n, 4, 4).
    """
    n = len(pictures)
    cameras = [Camera(each.intrinsics, pose) for each, pose in zip(pictures, poses, strict=True)]
    shared = np.zeros((n, n))
    for i in range(n):
        points, nearness = _samples(pictures[i], cameras[i])
        if not len(points):
            continue
        for j in set(range(n)) - {i}:
            seen = _seen(points, cameras[i], pictures[j], cameras[j])
            shared[i, j] = float(nearness @ seen) / float(nearness.sum())
    shared += shared.T
    nearest = np.argsort(-shared, axis=1, kind="stable")[:, :NEIGHBORS]
    chosen = {(i, int(j)) for i in range(n) for j in nearest[i] if shared[i, j] > LEAST_SHARED}
    both = chosen | {(j, i) for i, j in chosen}
    return np.array(sorted(both), dtype=np.int32).reshape(-1, 2)


def _samples(picture: Picture, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Return points in the world (k, 3), and how much each counts (k,): near ones place a camera best."""
    known = np.argwhere(np.isfinite(picture.depth))
    rows, columns = known[:: max(1, len(known) // SAMPLES)].T
    depth = picture.depth[rows, columns].astype(np.float64)
    k = picture.intrinsics
    return camera.unproject(pixel_centers(k.width, k.height)[rows, columns], depth), 1 / depth


def _seen(points: np.ndarray, first: Camera, picture: Picture, second: Camera) -> np.ndarray:
    """Return how well each point of the first camera is seen by the second, 0 to 1, (k,)."""
    px, depth = second.project(points)
    k = second.intrinsics
    with np.errstate(invalid="ignore"):
        inside = (depth > 0) & (px >= 0).all(axis=1) & (px < [k.width, k.height]).all(axis=1)
    column, row = np.where(inside[:, None], px, 0).astype(np.intp).T
    same = inside & (np.abs(picture.depth[row, column] - depth) < SAME_DEPTH * depth)
    here, there = (points - camera.center_world for camera in (first, second))
    lengths = np.linalg.norm(here, axis=1) * np.linalg.norm(there, axis=1)
    cosines = np.einsum("ki,ki->k", here, there) / np.maximum(lengths, 1e-12)
    angles = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    return same * np.clip(1 - angles / WIDEST_ANGLE, 0, 1)
