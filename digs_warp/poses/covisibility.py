"""Which frames see the same surface from directions that are not too different."""

from collections.abc import Sequence
from dataclasses import astuple

import numpy as np

from digs_warp.geometry.camera import Camera, pixel_centers
from digs_warp.geometry.reproject import ROUGH_POSES, Pinholes, compare_depth, reproject
from digs_warp.geometry.rigid import invert_rigid
from digs_warp.poses import thresholds
from digs_warp.poses.views import Picture

# Frames that each frame is compared with, at least; some are chosen by others as well.
NEIGHBORS = 8
# Points looked at in each frame.
SAMPLES = 1000
# A first look takes one of SCREENED_BY of these points, and keeps for each frame the SCREENED most promising
# others for a look at all of them.
SCREENED_BY, SCREENED = 8, 32


def overlapping_pairs(pictures: Sequence[Picture], poses: np.ndarray) -> np.ndarray:
    """Return pairs (source, target) in both directions, (k, 2), sorted; none for frames without depth.

    Args:
        pictures: of n frames.
        poses: ``world_from_cam``, (n, 4, 4).
    """
    n = len(pictures)
    shared = np.zeros((n, n))
    everything = _Everything(pictures, poses)
    for i in range(n):
        points, nearness = _samples(pictures[i], Camera(pictures[i].intrinsics, poses[i]))
        others = np.delete(np.arange(n), i)
        if not len(points) or not len(others):
            continue
        if len(others) > SCREENED:
            seen = everything.seen(i, others, points[::SCREENED_BY]) @ nearness[::SCREENED_BY]
            others = others[np.argsort(-seen, kind="stable")[:SCREENED]]
        shared[i, others] = everything.seen(i, others, points) @ nearness / nearness.sum()
    shared += shared.T
    nearest = np.argsort(-shared, axis=1, kind="stable")[:, :NEIGHBORS]
    chosen = {
        (i, int(j))
        for i in range(n)
        for j in nearest[i]
        if shared[i, j] > thresholds.MIN_COVISIBILITY
    }
    both = chosen | {(j, i) for i, j in chosen}
    return np.array(sorted(both), dtype=np.int32).reshape(-1, 2)


class _Everything:
    """All frames, to look up points of one in many others at once."""

    def __init__(self, pictures: Sequence[Picture], poses: np.ndarray) -> None:
        self._from_world = np.stack([invert_rigid(pose) for pose in poses])
        self._centers = poses[:, :3, 3]
        self._intrinsics = np.array([astuple(picture.intrinsics) for picture in pictures])
        self._depth = np.concatenate([picture.depth.reshape(-1) for picture in pictures])
        self._starts = np.cumsum([0, *(picture.depth.size for picture in pictures)])[:-1, None]

    def seen(self, number: int, others: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return how well others see the points of a frame, 0 to 1, (others, points)."""
        cameras = Pinholes(*self._intrinsics[others].T[..., None])
        seen = reproject(points, self._from_world[others], cameras)
        widths = cameras.width.astype(np.intp)
        measured = self._depth[self._starts[others] + seen.rows * widths + seen.columns]
        same = seen.inside & compare_depth(seen.depth, measured, ROUGH_POSES).agrees
        here, there = (points - self._centers[of] for of in (number, others[:, None]))
        lengths = np.linalg.norm(here, axis=-1) * np.linalg.norm(there, axis=-1)
        cosines = np.einsum("ki,nki->nk", here, there) / np.maximum(lengths, 1e-12)
        angles = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
        return same * np.clip(1 - angles / thresholds.MAX_VIEW_ANGLE, 0, 1)


def _samples(picture: Picture, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Return points in the world (k, 3), and how much each counts (k,): near ones place a camera best."""
    known = np.argwhere(np.isfinite(picture.depth))
    rows, columns = known[:: max(1, len(known) // SAMPLES)].T
    depth = picture.depth[rows, columns].astype(np.float64)
    k = picture.intrinsics
    return camera.unproject(pixel_centers(k.width, k.height)[rows, columns], depth), 1 / depth
