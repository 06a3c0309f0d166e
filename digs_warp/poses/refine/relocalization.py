"""Outlier frames, whose poses contradict color and depth of the frames around them, and where they belong.

Structure from motion may place a frame by what is far, which tells where a camera looks and hardly where it
is. Its frames then agree with each other but for one, which agrees with none, or has nothing in common with
any. It is placed again by features that other frames measure in the world (resection: `Correspondences`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from digs_warp.device.threads import over_items
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import invert_rigid, rigid, transform_points
from digs_warp.poses import thresholds
from digs_warp.poses.agreement import (
    correlation,
    disagreement,
    disagreements,
    measured_pairs,
    medians_of_frames,
    reduced,
)
from digs_warp.poses.covisibility import overlapping_pairs
from digs_warp.poses.features import Features, features_of, matched, reprojection_errors
from digs_warp.poses.refine.photometric_alignment import align, align_first
from digs_warp.poses.views import Picture, View, view_of

# Draws of three matches. In every other one near points come first: a camera that turns by a little less and
# shifts by a little more sees all that is far at the same pixels, and only few matches are near.
DRAWS = 600


@dataclass(frozen=True, eq=False)
class Correspondences:
    """Points in the world, and where a frame sees them; some are matched wrongly.

    Attributes:
        points_world: (n, 3) [m].
        px: pixel centers at +0.5, (n, 2).
        camera: of the frame.
        nearness: weights of the points in draws, (n,), sum 1.
    """

    points_world: np.ndarray
    px: np.ndarray
    camera: Intrinsics
    nearness: np.ndarray

    @staticmethod
    def of(
        picture: Picture, features: Features, others: Sequence[tuple[Features, np.ndarray]]
    ) -> "Correspondences":
        """Match a frame with others.

        Args:
            picture: of the frame.
            features: of the frame.
            others: features and ``world_from_cam`` of each other frame, with depth; at least one.
        """
        found = [(matched(each, features, picture.intrinsics), pose) for each, pose in others]
        world = [transform_points(pose, each.points) for each, pose in found]
        depth = np.concatenate([each.points[:, 2] for each, _ in found])
        near = 1 / depth**2
        px = np.concatenate([each.px for each, _ in found])
        return Correspondences(np.concatenate(world), px, picture.intrinsics, near / near.sum())

    def candidate_poses(self, most: int) -> list[np.ndarray]:
        """Return at most this many ``world_from_cam`` that miss few points, the best first."""
        import cv2

        if len(self.px) < thresholds.MIN_INLIERS:
            return []
        matrix = self.camera.matrix
        rng, found = np.random.default_rng(0), []
        for number in range(DRAWS):
            weights = self.nearness if number % 2 else None
            drawn = rng.choice(len(self.px), 3, replace=False, p=weights)
            points, px = self.points_world[drawn], self.px[drawn]
            _, turns, shifts = cv2.solveP3P(points, px, matrix, None, cv2.SOLVEPNP_AP3P)  # pyright: ignore[reportArgumentType, reportCallIssue]
            for turn, shift in zip(turns, shifts, strict=True):
                motion = rigid(cv2.Rodrigues(turn)[0], shift[:, 0])
                if np.isfinite(motion).all():
                    found.append((self._missed(motion), motion))
        found.sort(key=lambda each: each[0])
        return [invert_rigid(motion) for _, motion in found[:most]]

    def _missed(self, cam_from_world: np.ndarray) -> float:
        """Return the sum of the squares of what all points miss by [px^2]."""
        errors = reprojection_errors(self.points_world, self.px, cam_from_world, self.camera)
        return float(np.minimum(errors, thresholds.MAX_REPROJECTION_ERROR**2).sum())


SIGMAS = 1.4826
# Neighbors in time by which a frame is placed; candidate_poses that are tried, and those that are followed.
NEIGHBORS, TRIED, FOLLOWED = 6, 200, 3
# Points that are looked up for each that is tried.
COARSE_SAMPLES = 250


@dataclass(frozen=True, eq=False)
class RelocatedFrames:
    """What became of misplaced frames.

    Attributes:
        poses: ``world_from_cam`` of all frames, (n, 4, 4); new ones for those that were moved.
        start: the same, to align all frames from: aligned ones, if a frame could be placed only among them.
        moved: numbers of the frames that were registered again, and now agree as others do.
        lost: numbers of the frames that agree with no other, wherever they are placed.
    """

    poses: np.ndarray
    start: np.ndarray
    moved: tuple[int, ...] = ()
    lost: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class _Looks:
    """Frames as they are, and at the size at which they are compared."""

    pictures: Sequence[Picture]

    @cached_property
    def small(self) -> list[Picture]:
        return reduced(self.pictures)

    @cached_property
    def views(self) -> list[View]:
        """Of the small ones."""
        return over_items(self.small, view_of)


def relocated(pictures: Sequence[Picture], poses: np.ndarray) -> RelocatedFrames:
    """Register again what agrees far less with the frames around it than all others do.

    Args:
        pictures: of n frames, in order of time; what has no depth stays where it is.
        poses: ``world_from_cam``, (n, 4, 4).
    """
    looks = _Looks(pictures)
    pairs = overlapping_pairs(looks.small, poses)
    apart = _apart(looks, poses, pairs)
    known = np.isfinite(apart)
    if np.count_nonzero(known) < thresholds.MIN_RELOCALIZED_FRAMES:
        return RelocatedFrames(poses, poses)
    limit = _limit(apart)
    wrong = np.flatnonzero(apart > limit)
    if len(wrong) > thresholds.MAX_OUTLIER_SHARE * np.count_nonzero(known):
        return RelocatedFrames(poses, poses)
    untouched = pairs[~np.isin(pairs, wrong).any(axis=1)]
    unrelated = _unrelated(pictures, known, _matches(looks, poses, untouched), wrong)
    if not len(wrong) + len(unrelated):
        return RelocatedFrames(poses, poses)
    right = np.setdiff1d(np.flatnonzero(known), np.union1d(wrong, unrelated))
    placed = _with_placed(looks, poses, wrong, right)
    after = _apart(looks, placed, overlapping_pairs(looks.small, placed))
    holds = after < np.minimum(limit, apart - thresholds.MIN_OUTLIER_DISAGREEMENT)
    left = wrong[~holds[wrong]]
    placed[left] = poses[left]
    relocation = RelocatedFrames(placed, placed, _numbers(wrong[holds[wrong]]))
    doubted = left[apart[left] > thresholds.MAX_STEP_DISAGREEMENT]
    if not len(doubted) + len(unrelated):
        return relocation
    return _relocated_among_aligned(looks, relocation, doubted, unrelated, right)


def _unrelated(
    pictures: Sequence[Picture], known: np.ndarray, matches: np.ndarray, wrong: np.ndarray
) -> np.ndarray:
    """Return the numbers of frames that nothing contradicts, and that have little in common with the others.

    They may be in a wrong place, or see what no other sees.

    Args:
        pictures: of n frames.
        known: whether each has something in common with others, (n,).
        matches: how well its details match theirs, (n,); NaN: unknown.
        wrong: numbers of frames that others contradict.
    """
    has_depth = np.array([bool(np.isfinite(each.depth).any()) for each in pictures])
    usual = np.nanmedian(matches)
    unrelated = has_depth & ~known
    if usual >= thresholds.MIN_USUAL_CORRELATION:
        unrelated |= matches < thresholds.MAX_UNRELATED_CORRELATION * usual
    found = np.setdiff1d(np.flatnonzero(unrelated), wrong)
    few = len(found) + len(wrong) <= thresholds.MAX_OUTLIER_SHARE * np.count_nonzero(has_depth)
    return found if few else found[:0]


def _with_placed(
    looks: _Looks, poses: np.ndarray, wrong: np.ndarray, right: np.ndarray
) -> np.ndarray:
    """Return the poses, those of wrong frames by right ones."""
    placed = poses.copy()
    for number in wrong:
        placed[number] = _placed(looks, poses, int(number), right)
    return placed


def _limit(apart: np.ndarray) -> float:
    usual = np.nanmedian(apart)
    spread = SIGMAS * np.nanmedian(np.abs(apart - usual))
    return float(
        usual + max(thresholds.MIN_OUTLIER_DISAGREEMENT, thresholds.MIN_OUTLIER_DEVIATIONS * spread)
    )


def _apart(looks: _Looks, poses: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return the median disagreement of each frame with the others, (n,); NaN for what has no pair."""
    found = measured_pairs(disagreement, looks.small, poses, pairs)
    return medians_of_frames(pairs, len(poses), found)


def _placed(looks: _Looks, poses: np.ndarray, number: int, right: np.ndarray) -> np.ndarray:
    """Return the pose of a frame by the features and the alignment of right neighbors; they stay."""
    pictures, small = looks.pictures, looks.small
    near = right[np.argsort(np.abs(right - number), kind="stable")[:NEIGHBORS]]
    features = over_items([pictures[each] for each in (number, *near)], features_of)
    others = list(zip(features[1:], poses[near], strict=True))
    starts = Correspondences.of(pictures[number], features[0], others).candidate_poses(TRIED)

    def doubts(tried: Sequence[np.ndarray], most: int) -> np.ndarray:
        def against(other: int) -> np.ndarray:
            motions = [invert_rigid(pose) @ poses[other] for pose in tried]
            return disagreements(small[other], small[number], motions, most)

        return np.mean(over_items(list(near), against), axis=0)

    best: list[np.ndarray] = [poses[number]]
    if starts:
        order = np.argsort(doubts(starts, COARSE_SAMPLES), kind="stable")[:FOLLOWED]
        best += [starts[each] for each in order]
    group = [pictures[each] for each in (number, *near)]
    aligned = [align_first(group, np.stack([pose, *poses[near]])) for pose in best]
    tried = [*best, *aligned]
    # Where nothing is shared, little is contradicted: there, details that match tell right poses.
    views = [looks.views[each] for each in (number, *near)]
    matching = [_matching(views, np.stack([pose, *poses[near]])) for pose in tried]
    return tried[int(np.argmin(doubts(tried, 3 * COARSE_SAMPLES) - matching))]


def _matching(views: Sequence[View], poses: np.ndarray) -> float:
    """Return how well details of the first frame match those of the others."""
    pairs = np.array([(0, other) for other in range(1, len(views))])
    return float(np.mean(measured_pairs(correlation, views, poses, pairs)))


def _relocated_among_aligned(
    looks: _Looks,
    relocation: RelocatedFrames,
    doubted: np.ndarray,
    unrelated: np.ndarray,
    right: np.ndarray,
) -> RelocatedFrames:
    """Place what is left once the others are aligned: before, all poses may be a little off.

    What was in doubt, and then neither agrees with the others nor matches their details, is lost. What was
    unrelated, and does not match them, stays where it was.
    """
    doubted_or_unrelated = np.union1d(doubted, unrelated)
    others = np.setdiff1d(np.arange(len(looks.pictures)), doubted_or_unrelated)
    start = relocation.poses.copy()
    alignment = align([looks.pictures[each] for each in others], start[others])
    if alignment is not None:
        start[others] = alignment.poses
    start = _with_placed(looks, start, doubted_or_unrelated, right)
    pairs = overlapping_pairs(looks.small, start)
    apart, matches = _apart(looks, start, pairs), _matches(looks, start, pairs)
    agrees = matches >= thresholds.MIN_RELOCALIZED_CORRELATION * np.nanmedian(matches[right])
    start[unrelated] = np.where(
        agrees[unrelated, None, None], start[unrelated], relocation.poses[unrelated]
    )
    agrees[doubted] |= apart[doubted] <= min(thresholds.MAX_STEP_DISAGREEMENT, _limit(apart[right]))
    poses = relocation.poses.copy()
    found, lost = doubted_or_unrelated[agrees[doubted_or_unrelated]], doubted[~agrees[doubted]]
    poses[found] = start[found]
    return RelocatedFrames(
        poses, start, tuple(sorted(relocation.moved + _numbers(found))), _numbers(lost)
    )


def _matches(looks: _Looks, poses: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return how well each frame's details match those of the others, (n,); NaN for what has no pair."""
    found = measured_pairs(correlation, looks.views, poses, pairs)
    return medians_of_frames(pairs, len(poses), found)


def _numbers(some: np.ndarray) -> tuple[int, ...]:
    return tuple(map(int, some))
