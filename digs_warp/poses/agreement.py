"""Which frames see the same (`overlapping_pairs`), and whether two agree under a motion.

`disagreement` compares depth, and brightness and tint where depth agrees; `correlation` compares details
without their exposure; `measured_pairs` asks either of many pairs of frames.
"""

from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass
from typing import TypeVar

import numpy as np

from digs_warp.device.threads import over_items
from digs_warp.geometry.camera import Camera, pixel_centers
from digs_warp.geometry.reproject import (
    ROUGH_POSES,
    Pinholes,
    compare_depth,
    project,
    reproject,
    unproject_pixels,
)
from digs_warp.geometry.rigid import invert_rigid, transform_points
from digs_warp.poses import thresholds
from digs_warp.poses.views import Picture, View

_F = TypeVar("_F")


def motions_of(poses: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return ``target_from_source`` of pairs (source, target), (k, 2), of ``world_from_cam``, (n, 4, 4)."""
    return np.stack([invert_rigid(poses[j]) @ poses[i] for i, j in pairs])


def measured_pairs(
    measure: Callable[[_F, _F, np.ndarray], float],
    frames: Sequence[_F],
    poses: np.ndarray,
    pairs: np.ndarray,
) -> np.ndarray:
    """Return ``measure(source, target, target_from_source)`` of each pair, (k,), computed on all cores.

    Args:
        measure: what is asked of two frames and the motion between them.
        frames: n, in the form that ``measure`` takes.
        poses: ``world_from_cam``, (n, 4, 4).
        pairs: numbers of source and target, (k, 2).
    """

    def measured(pair: np.ndarray) -> float:
        i, j = pair
        return measure(frames[i], frames[j], invert_rigid(poses[j]) @ poses[i])

    return np.array(over_items(list(pairs), measured))


def medians_of_frames(pairs: np.ndarray, count: int, values: np.ndarray) -> np.ndarray:
    """Return the median of the values (k,) of each frame's pairs, (count,); NaN for what has no pair."""
    found = np.full(count, np.nan)
    for number in np.unique(pairs):
        found[number] = np.median(values[(pairs == number).any(axis=1)])
    return found


# The widest images in which frames are compared [px].
COMPARED = 320
# Points of a frame that are looked up in another.
SAMPLES = 700
# Differences that count as a whole one: of depth (a share of it; more beyond the usual distance, where stereo
# is noisy), of brightness (0..1) and of tint.
OTHER_DEPTH, OTHER_BRIGHTNESS, OTHER_TINT = 0.06, 0.1, 0.05
# What a point counts of which the other frame says nothing: outside of it, or behind what it sees.
UNSEEN, HIDDEN = 1.2, 0.9
# What a missing depth counts: half a difference, and the colors are compared.
NO_DEPTH = 0.5
# What a point counts that the other frame looks through.
CONTRADICTED = 2.0


@dataclass(frozen=True, eq=False)
class Samples:
    """Points of a frame that are looked up in others.

    Attributes:
        points: in the axes of its camera [m], (n, 3).
        brightness: of each, (n,).
        tint: of each, (n, 2).
        weights: near points count most, (n,), sum 1.
        near: the usual distance [m]: the harmonic mean of the depth.
    """

    points: np.ndarray
    brightness: np.ndarray
    tint: np.ndarray
    weights: np.ndarray
    near: float

    @staticmethod
    def of(picture: Picture, most: int = SAMPLES) -> "Samples":
        """Return every n-th pixel that has depth, at least ``most`` where there are as many."""
        known = np.argwhere(np.isfinite(picture.depth))
        rows, columns = known[:: max(1, len(known) // most)].T
        z = picture.depth[rows, columns].astype(np.float64)
        points = unproject_pixels(rows, columns, z, picture.intrinsics)
        found = picture.brightness[rows, columns], picture.tint[rows, columns]
        inverse = 1 / z
        weights = inverse / inverse.sum()
        return Samples(points, *found, weights, float(1 / inverse.mean()))


def reduced(pictures: Sequence[Picture]) -> list[Picture]:
    """Return the pictures at the size at which they are compared."""
    return [picture.at_most(COMPARED) for picture in pictures]


def disagreement(first: Picture, second: Picture, second_from_first: np.ndarray) -> float:
    """Return how much two frames contradict each other under a motion, 0 to 2; 1.2: nothing is shared.

    The mean over points of the larger of both directions; near points count more.
    """
    return float(disagreements(first, second, [second_from_first])[0])


def disagreements(
    first: Picture, second: Picture, motions: Sequence[np.ndarray], most: int = SAMPLES
) -> np.ndarray:
    """Return `disagreement` under each of m motions ``second_from_first``, (m,), from ``most`` points."""
    there = _one_way(Samples.of(first, most), second, np.stack(motions))
    back = np.stack([invert_rigid(motion) for motion in motions])
    return np.maximum(there, _one_way(Samples.of(second, most), first, back))


def got_worse(
    pictures: Sequence[Picture],
    before: np.ndarray,
    after: np.ndarray,
    pairs: np.ndarray,
    by: float = 1.0,
) -> np.ndarray:
    """Return for each of n frames whether it would agree better with its old pose, (n,), bool.

    Where little holds a frame, an alignment may slide. All other frames have their new poses in both cases:
    a frame that kept its own while they moved together would agree with none of them.

    Args:
        pictures: of the frames.
        before: their ``world_from_cam``, (n, 4, 4).
        after: the same after the alignment.
        pairs: numbers of frames that see the same, (k, 2).
        by: how many times as much it has to contradict the others with its new pose.
    """

    def compared(number: int) -> np.ndarray:
        i, j = pairs[number]
        candidate_poses = ((after[i], after[j]), (before[i], after[j]), (after[i], before[j]))
        motions = [invert_rigid(second) @ first for first, second in candidate_poses]
        return disagreements(pictures[i], pictures[j], motions)

    old, new = np.zeros(len(before)), np.zeros(len(before))
    for (i, j), found in zip(pairs, over_items(range(len(pairs)), compared), strict=True):
        together, i_old, j_old = found
        new[[i, j]] += together
        old[[i, j]] += i_old, j_old
    return by * old < new


def _one_way(samples: Samples, other: Picture, motions: np.ndarray) -> np.ndarray:
    """Return the mean over the points under each motion, (m,)."""
    seen = reproject(samples.points, motions, other.intrinsics)
    row, column, safe = seen.rows, seen.columns, np.where(seen.inside, seen.depth, 1.0)
    behind = (seen.depth - other.depth[row, column]) / safe / OTHER_DEPTH
    behind /= np.maximum(1.0, safe / samples.near)
    darker = np.abs(other.brightness[row, column] - samples.brightness) / OTHER_BRIGHTNESS
    tinted = np.abs(other.tint[row, column] - samples.tint).sum(axis=2) / OTHER_TINT
    color = np.minimum(darker + tinted, 1.0)
    known = np.isfinite(behind)
    each = np.where(known, np.minimum(np.abs(behind), 1.0), NO_DEPTH) + color
    each = np.where(known & (behind > 1), HIDDEN, each)
    each = np.where(known & (behind < -1), CONTRADICTED, each)
    return np.where(seen.inside, each, UNSEEN) @ samples.weights


def correlation(first: View, second: View, second_from_first: np.ndarray) -> float:
    """Return the correlation of brightness, less its mean nearby and over its contrast, -1 to 1.

    Over the points of a frame where the other measures the same depth, the smaller of both directions; 0 if
    there are few. Right motions have much of it in any light, where walls have any texture at all; wrong ones
    have little, unless the texture repeats.
    """
    there = _correlation_one_way(first, second, second_from_first)
    return min(there, _correlation_one_way(second, first, invert_rigid(second_from_first)))


def _correlation_one_way(view: View, other: View, motion: np.ndarray) -> float:
    from scipy.ndimage import map_coordinates

    k = other.picture.intrinsics
    moved = transform_points(motion, view.points.astype(np.float64))
    u, v, z = project(_when_read(moved, other.picture), k)
    u, v = u - 0.5, v - 0.5  # whole ones at the centers of pixels
    inside = (z > 0) & (u >= 0) & (u < k.width - 1) & (v >= 0) & (v < k.height - 1)
    u, v, z, values = u[inside], v[inside], z[inside], view.values[inside]
    measured = other.picture.depth[np.rint(v).astype(np.intp), np.rint(u).astype(np.intp)]
    same = compare_depth(z, measured).agrees
    if np.count_nonzero(same) < max(
        thresholds.MIN_CORRELATED, thresholds.MIN_CORRELATED_SHARE * len(view.points)
    ):
        return 0.0
    places = np.stack([v[same], u[same]])
    seen = map_coordinates(other.image, places, np.float64, order=1)
    expected = values[same].astype(np.float64)
    seen, expected = seen - seen.mean(), expected - expected.mean()
    lengths = np.linalg.norm(seen) * np.linalg.norm(expected)
    return float(seen @ expected / lengths) if lengths > 0 else 0.0


def _when_read(points: np.ndarray, picture: Picture) -> np.ndarray:
    """Return the points in the axes that the camera has when it reads their rows, (n, 3)."""
    _, row, depth = project(points, picture.intrinsics)
    moment = np.where(depth > 0, row / picture.intrinsics.height - 0.5, 0.0)[:, None]
    return points - moment * (np.cross(picture.turn, points) + picture.shift)


# Frames that each frame is compared with, at least; some are chosen by others as well.
NEIGHBORS = 8
# Points looked at in each frame.
SHARED_SAMPLES = 1000
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
    rows, columns = known[:: max(1, len(known) // SHARED_SAMPLES)].T
    depth = picture.depth[rows, columns].astype(np.float64)
    k = picture.intrinsics
    return camera.unproject(pixel_centers(k.width, k.height)[rows, columns], depth), 1 / depth
