"""Which frames see the same surface from directions that are not too different."""

from collections.abc import Sequence
from dataclasses import astuple

import numpy as np

from digs_warp.geometry.camera import Camera, pixel_centers
from digs_warp.geometry.reproject import ROUGH_POSES, Pinholes, compare_depth, reproject
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
    cameras = [Camera(each.intrinsics, pose) for each, pose in zip(pictures, poses, strict=True)]
    shared = np.zeros((n, n))
    everything = _Everything(pictures, cameras)
    for i in range(n):
        points, nearness = _samples(pictures[i], cameras[i])
        if not len(points):
            continue
        for j in everything.worth_a_look(i, points[::SCREENED_BY], nearness[::SCREENED_BY]):
            seen = _seen(points, cameras[i], pictures[j], cameras[j])
            shared[i, j] = float(nearness @ seen) / float(nearness.sum())
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
    """All frames at once, to leave out most pairs: their number grows with the square of the frames."""

    def __init__(self, pictures: Sequence[Picture], cameras: Sequence[Camera]) -> None:
        self._from_world = np.stack([camera.cam_from_world for camera in cameras])
        self._centers = np.stack([camera.center_world for camera in cameras])
        fields = [astuple(picture.intrinsics) for picture in pictures]
        self._intrinsics = Pinholes(*np.array(fields).T[..., None])
        self._depth = np.concatenate([picture.depth.reshape(-1) for picture in pictures])
        self._starts = np.cumsum([0, *(picture.depth.size for picture in pictures)])[:-1, None]

    def worth_a_look(self, number: int, points: np.ndarray, nearness: np.ndarray) -> list[int]:
        """Return the `SCREENED` frames that see most of some points of a frame, best first; all if few."""
        others = [j for j in range(len(self._centers)) if j != number]
        if len(others) <= SCREENED:
            return others
        seen = reproject(points, self._from_world, self._intrinsics)
        widths = self._intrinsics.width.astype(np.intp)
        measured = self._depth[self._starts + seen.rows * widths + seen.columns]
        same = seen.inside & compare_depth(seen.depth, measured, ROUGH_POSES).agrees
        rays = points - self._centers[:, None]
        rays /= np.maximum(np.linalg.norm(rays, axis=2, keepdims=True), 1e-12)
        cosines = np.einsum("nki,ki->nk", rays, rays[number])
        angles = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
        shared = (same * np.clip(1 - angles / thresholds.MAX_VIEW_ANGLE, 0, 1)) @ nearness
        shared[number] = -1.0
        return np.argsort(-shared, kind="stable")[:SCREENED].tolist()


def _samples(picture: Picture, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Return points in the world (k, 3), and how much each counts (k,): near ones place a camera best."""
    known = np.argwhere(np.isfinite(picture.depth))
    rows, columns = known[:: max(1, len(known) // SAMPLES)].T
    depth = picture.depth[rows, columns].astype(np.float64)
    k = picture.intrinsics
    return camera.unproject(pixel_centers(k.width, k.height)[rows, columns], depth), 1 / depth


def _seen(points: np.ndarray, first: Camera, picture: Picture, second: Camera) -> np.ndarray:
    """Return how well each point of the first camera is seen by the second, 0 to 1, (k,)."""
    seen = reproject(points, second.cam_from_world, second.intrinsics)
    measured = picture.depth[seen.rows, seen.columns]
    same = seen.inside & compare_depth(seen.depth, measured, ROUGH_POSES).agrees
    here, there = (points - camera.center_world for camera in (first, second))
    lengths = np.linalg.norm(here, axis=1) * np.linalg.norm(there, axis=1)
    cosines = np.einsum("ki,ki->k", here, there) / np.maximum(lengths, 1e-12)
    angles = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    return same * np.clip(1 - angles / thresholds.MAX_VIEW_ANGLE, 0, 1)
