"""The motion between two frames by their color and depth: an edge of the pose graph.

A motion starts from matched features, from the motion before, or from what a hand or a head does
(`likely_starts`). Open3D's odometry finds it from farther off than `align_pair` does where there is little
texture; the alignment has the last word. The edge keeps how well both frames agree under the motion, and how
firmly what they share holds it (`information`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.device.libraries import import_open3d
from digs_warp.device.threads import over_items
from digs_warp.geometry.reproject import SAME_SURFACE, DepthTolerance, compare_depth, reproject
from digs_warp.geometry.rigid import matrix_from_rotation_vector, rigid
from digs_warp.poses import thresholds
from digs_warp.poses.agreement import COMPARED, correlation, disagreement, disagreements
from digs_warp.poses.features import Features, Matches, features_of, matched
from digs_warp.poses.refine.photometric_alignment import align_pair, pyramid_of
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


# Steps at each size, from the smallest image.
STEPS = (20, 15, 10)
# Open3D's threads add up in another order each time, which changes the last of 16 digits; this many are kept.
DIGITS = 9


def odometry(first: Picture, second: Picture, start: np.ndarray) -> np.ndarray:
    """Return ``second_from_first`` by color and depth together, (4, 4); the start where that fails.

    Park et al., "Colored point cloud registration revisited", ICCV 2017.
    """
    open3d = import_open3d()
    pipeline = open3d.pipelines.odometry
    near, k = usual_distance(first), first.intrinsics
    option = pipeline.OdometryOption(
        iteration_number_per_pyramid_level=open3d.utility.IntVector(STEPS),
        depth_diff_max=SAME_SURFACE.relative * near,
        depth_min=0.0,
        depth_max=FARTHEST * near,
    )
    # Open3D puts integers at the centers of pixels.
    camera = open3d.camera.PinholeCameraIntrinsic(
        k.width, k.height, k.fx, k.fy, k.cx - 0.5, k.cy - 0.5
    )
    good, motion, _ = pipeline.compute_rgbd_odometry(
        _rgbd_image(first),
        _rgbd_image(second),
        camera,
        start,
        pipeline.RGBDOdometryJacobianFromHybridTerm(),
        option,
    )
    return np.round(motion, DIGITS) if good else start


def _rgbd_image(picture: Picture):
    geometry = import_open3d().geometry
    planes = np.float32(picture.brightness), np.nan_to_num(picture.depth, nan=0.0)
    color, depth = (geometry.Image(np.ascontiguousarray(each, np.float32)) for each in planes)
    return geometry.RGBDImage.create_from_color_and_depth(color, depth, 1.0, np.inf, False)


# A hand that walks round something turns the camera about what it sees, by up to this [degree], about an axis
# that is upright: the camera looks down on it by one of these [degree].
TURNS = (-36.0, -30.0, -24.0, -18.0, -12.0, -6.0, 6.0, 12.0, 18.0, 24.0, 30.0, 36.0)
TILTS = (0.0, 30.0, 60.0)
# It looks from higher or lower by this [degree], and a head turns on the spot by these.
RISES = (-10.0, 10.0)
GLANCES = (-30.0, -20.0, -10.0, 10.0, 20.0, 30.0)
# Points of a frame that are looked up for each.
COARSE_SAMPLES = 250


def likely_starts(
    first: Picture, second: Picture, before: np.ndarray, most: int
) -> list[np.ndarray]:
    """Return the ``most`` motions ``second_from_first`` under which small pictures agree best, best first.

    The pictures have about 80 columns; ``before``: the motion between the frames before, which may go on.
    """
    motions = [np.eye(4), before, *_usual_motions(first)]
    apart = disagreements(first, second, motions, COARSE_SAMPLES)
    return [motions[number] for number in np.argsort(apart, kind="stable")[:most]]


def _usual_motions(picture: Picture) -> list[np.ndarray]:
    pivot = np.array([0.0, 0.0, _middle_distance(picture)])
    tilts = np.radians(TILTS)
    upright = np.stack([np.zeros(len(TILTS)), np.cos(tilts), np.sin(tilts)], axis=1)
    across, down = np.eye(3)[:2]
    turns = [angle * axis for axis in upright for angle in np.radians(TURNS)]
    rises = [angle * across for angle in np.radians(RISES)]
    glances = [angle * axis for axis in (across, down) for angle in np.radians(GLANCES)]
    return [
        *(_turned(vector, pivot) for vector in (*turns, *rises)),
        *(_turned(vector, np.zeros(3)) for vector in glances),
    ]


def _turned(vector: np.ndarray, pivot: np.ndarray) -> np.ndarray:
    turn = matrix_from_rotation_vector(vector)
    return rigid(turn, pivot - turn @ pivot)


def _middle_distance(picture: Picture) -> float:
    """Return the usual distance [m] in the middle of the picture, or in all of it where that has no depth."""
    k = picture.intrinsics
    inner = picture.depth[k.height // 4 : -k.height // 4, k.width // 4 : -k.width // 4]
    known = inner if np.isfinite(inner).any() else picture.depth
    return float(1 / np.nanmean(1 / known))


# The widest images of the search for starts [px]; frames are aligned at the size at which they are compared.
WIDEST_OF_STARTS = 100
# Starts that are tried at a fourth of the size, and the best of them that are followed.
TRIED, FOLLOWED = 6, 2
# Inliers make up for disagreement: `MIN_CERTAIN_INLIERS` of them, or more, for this much.
WORTH_OF_INLIERS = 0.15


@dataclass(frozen=True, eq=False)
class FrameFeatures:
    """A frame as its motion is measured.

    Attributes:
        pyramid: views from small ones to at most `COMPARED` columns.
        coarse: the same to at most `WIDEST_OF_STARTS`.
        features: of ``large``.
        large: the frame as it was given.
    """

    pyramid: tuple[View, ...]
    coarse: tuple[View, ...]
    features: Features
    large: Picture

    @property
    def picture(self) -> Picture:
        """At most `COMPARED` columns."""
        return self.pyramid[-1].picture

    @staticmethod
    def of(picture: Picture) -> "FrameFeatures":
        """Return a frame at its sizes, with its features."""
        small = picture.at_most(COMPARED)
        coarse = pyramid_of(small.at_most(WIDEST_OF_STARTS))
        return FrameFeatures(pyramid_of(small), coarse, features_of(picture), picture)


@dataclass(frozen=True, eq=False)
class Edge:
    """A measured motion between two frames.

    Attributes:
        source: number of the first frame.
        target: number of the second.
        target_from_source: (4, 4), metres.
        information: of the motion, (6, 6), rotation first, as Open3D's pose graphs have it.
        disagreement: of the frames under it, up to 2; see `digs_warp.poses.agreement`; less where features
            match.
        matches: features that match under it.
        correlation: of the frames' details under it; see `digs_warp.poses.agreement`.
    """

    source: int
    target: int
    target_from_source: np.ndarray
    information: np.ndarray
    disagreement: float
    matches: int
    correlation: float


@dataclass(frozen=True, eq=False)
class FramePair:
    """Two frames whose motion is measured.

    Attributes:
        source: number of the first frame.
        target: number of the second.
        first, second: the frames.
        matches: their features.
        by_features: ``target_from_source`` on which most matches agree; None if they are few.
    """

    source: int
    target: int
    first: FrameFeatures
    second: FrameFeatures
    matches: Matches
    by_features: np.ndarray | None

    @staticmethod
    def of(features: Sequence[FrameFeatures], source: int, target: int) -> "FramePair":
        """Match the features of two frames of a recording; both have depth."""
        first, second = features[source], features[target]
        matches = matched(first.features, second.features, second.large.intrinsics)
        return FramePair(source, target, first, second, matches, matches.motion())

    @property
    def is_certain(self) -> bool:
        """Whether enough features match to try no other start."""
        return (
            self.by_features is not None
            and self.matches.agreeing(self.by_features) >= thresholds.MIN_CERTAIN_INLIERS
        )

    def edge(self, before: np.ndarray, search: bool = True) -> Edge:
        """Return the motion under which the frames agree best.

        It starts from the motion on which many matched features with depth agree. If they are few, it starts
        from ``before``, a likely ``target_from_source``, as well and, with ``search``, from motions of a hand
        or a head under which both frames agree best, and odometry goes on from there. `align_pair` has the
        last word; it knows that the noise of depth grows with distance.
        """
        if self.by_features is not None and self.is_certain:
            starts = [self.by_features]
        else:
            starts = [before] if self.by_features is None else [before, self.by_features]
            starts += self._searched(before) if search else []
        candidates = [
            motion for motions in over_items(starts, self._followed) for motion in motions
        ]
        return min(map(self._edge, candidates), key=lambda edge: edge.disagreement)

    def _searched(self, before: np.ndarray) -> list[np.ndarray]:
        """Return the best motions of a hand or a head, tried in small images."""
        first, second = self.first.coarse, self.second.coarse
        small = first[-1].picture, second[-1].picture
        likely = likely_starts(*small, before, TRIED)
        followed = over_items(likely, lambda motion: align_pair(first, second, motion))
        return sorted(followed, key=lambda motion: self._doubt(*small, motion))[:FOLLOWED]

    def _followed(self, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return a start, or what odometry makes of it where few features match, and where it is aligned."""
        first, second = self.first.pyramid, self.second.pyramid
        if not self.is_certain:
            pictures = first[-1].picture, second[-1].picture
            moved = odometry(*pictures, start)
            start = min((start, moved), key=lambda motion: self._doubt(*pictures, motion))
        return start, align_pair(first, second, start)

    def _edge(self, motion: np.ndarray) -> Edge:
        first, second = self.first.pyramid[-1], self.second.pyramid[-1]
        pictures = first.picture, second.picture
        return Edge(
            source=self.source,
            target=self.target,
            target_from_source=motion,
            information=information(first, second, motion),
            disagreement=self._doubt(*pictures, motion),
            matches=self.matches.agreeing(motion),
            correlation=correlation(first, second, motion),
        )

    def _doubt(self, first: Picture, second: Picture, motion: np.ndarray) -> float:
        """Return the disagreement of both frames, less what matched features speak for the motion."""
        agreeing = min(1.0, self.matches.agreeing(motion) / thresholds.MIN_CERTAIN_INLIERS)
        return disagreement(first, second, motion) - WORTH_OF_INLIERS * agreeing
