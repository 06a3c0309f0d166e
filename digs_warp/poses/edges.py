"""The motion between two frames by their color and depth: where to start, and under which they agree best."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.device.libraries import import_open3d
from digs_warp.geometry import invert_rigid
from digs_warp.poses.agreement import disagreement
from digs_warp.poses.align import align
from digs_warp.poses.features import Features, Matches, features_of, matched
from digs_warp.poses.starts import likely_starts
from digs_warp.poses.views import Picture

# The widest images of the odometry and of the search for starts [px].
WIDEST, WIDEST_OF_STARTS = 320, 100
# Starts that are tried at a fourth of the size, and the best of them that are followed.
TRIED, FOLLOWED = 6, 2
# Steps of the odometry at each size, from the smallest image.
ODOMETRY_STEPS = (20, 15, 10)
# Depths that differ by more than this share of the usual distance belong to different surfaces.
SAME_SURFACE = 0.05
# Farther than this many usual distances, depth is too noisy to place a camera.
FARTHEST = 3.0
# Matched features that agree with a motion make up for disagreement: MATCHES of them, or more, for WORTH.
# With MATCHES, no other start is tried.
MATCHES, WORTH = 40, 0.15


@dataclass(frozen=True, eq=False)
class Sight:
    """A frame as its motion is measured.

    Attributes:
        picture: at most `WIDEST` columns.
        coarse: the same at most `WIDEST_OF_STARTS` wide.
        features: of ``large``.
        large: the frame as it was given.
    """

    picture: Picture
    coarse: Picture
    features: Features
    large: Picture

    @staticmethod
    def of(picture: Picture) -> "Sight":
        """Return a frame at its sizes, with its features."""
        small = picture.at_most(WIDEST)
        return Sight(small, small.at_most(WIDEST_OF_STARTS), features_of(picture), picture)


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
    """

    source: int
    target: int
    target_from_source: np.ndarray
    information: np.ndarray
    disagreement: float
    matches: int


def usual_distance(picture: Picture) -> float:
    """Return the harmonic mean of the depth [m]: near things place a camera best."""
    return float(1 / np.nanmean(1 / picture.depth))


def edge_between(
    sights: Sequence[Sight], source: int, target: int, before: np.ndarray, search: bool = True
) -> Edge:
    """Return the motion under which two frames agree best.

    It starts from the motion on which many matched features with depth agree. If they are few, it starts from
    ``before`` as well, and from motions of a hand or a head under which both frames agree best. From there go
    Open3D's odometry (color and depth together; Park et al., "Colored point cloud registration revisited",
    ICCV 2017) and the package's own alignment, which knows that the noise of depth grows with distance.

    Args:
        sights: of the recording; both frames have depth.
        source: number of a frame.
        target: number of another.
        before: ``target_from_source`` that is likely, (4, 4).
        search: whether to look for other starts.
    """
    first, second = sights[source], sights[target]
    matches = matched(first.features, second.features, second.large.intrinsics)
    by_features = matches.motion()
    if by_features is not None and matches.agreeing(by_features) >= MATCHES:
        starts = [by_features]
    else:
        starts = [before] if by_features is None else [before, by_features]
        starts += _searched(first, second, before, matches) if search else []
    found: list[Edge] = []
    for start in starts:
        moved, information = _odometry(first.picture, second.picture, start)
        # Where little holds it, the odometry runs away.
        best = min(
            (start, moved),
            key=lambda motion: _doubt(first.picture, second.picture, motion, matches),
        )
        for motion in (best, _aligned(first.picture, second.picture, best)):
            apart = _doubt(first.picture, second.picture, motion, matches)
            found.append(Edge(source, target, motion, information, apart, matches.agreeing(motion)))
    return min(found, key=lambda edge: edge.disagreement)


def _searched(
    first: Sight, second: Sight, before: np.ndarray, matches: Matches
) -> list[np.ndarray]:
    likely = likely_starts(first.coarse, second.coarse, before, TRIED)
    followed = [_aligned(first.coarse, second.coarse, motion) for motion in likely]
    return sorted(followed, key=lambda m: _doubt(first.coarse, second.coarse, m, matches))[
        :FOLLOWED
    ]


def _doubt(first: Picture, second: Picture, motion: np.ndarray, matches: Matches) -> float:
    """Return the disagreement of two frames, less what matched features speak for the motion."""
    agreeing = min(1.0, matches.agreeing(motion) / MATCHES)
    return disagreement(first, second, motion) - WORTH * agreeing


def _aligned(first: Picture, second: Picture, motion: np.ndarray) -> np.ndarray:
    """Return the motion after `align` of the two; the same where they have nothing in common."""
    found = align([first, second], np.stack([np.eye(4), invert_rigid(motion)]), threads=1)
    return motion if found is None else invert_rigid(found.poses[1]) @ found.poses[0]


def _odometry(first: Picture, second: Picture, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return ``second_from_first`` and its information by Open3D; the start where that fails."""
    open3d = import_open3d()
    odometry = open3d.pipelines.odometry
    near = usual_distance(first)
    option = odometry.OdometryOption(
        iteration_number_per_pyramid_level=open3d.utility.IntVector(ODOMETRY_STEPS),
        depth_diff_max=SAME_SURFACE * near,
        depth_min=0.0,
        depth_max=FARTHEST * near,
    )
    k = first.intrinsics
    # Open3D puts integers at the centers of pixels.
    camera = open3d.camera.PinholeCameraIntrinsic(
        k.width, k.height, k.fx, k.fy, k.cx - 0.5, k.cy - 0.5
    )
    term = odometry.RGBDOdometryJacobianFromHybridTerm()
    good, motion, information = odometry.compute_rgbd_odometry(
        _rgbd_image(first), _rgbd_image(second), camera, start, term, option
    )
    return (motion, information) if good else (start, np.eye(6))


def _rgbd_image(picture: Picture):
    geometry = import_open3d().geometry
    image = geometry.RGBDImage()
    image.color = geometry.Image(np.ascontiguousarray(picture.brightness, np.float32))
    depth = np.nan_to_num(picture.depth, nan=0.0).astype(np.float32)
    image.depth = geometry.Image(np.ascontiguousarray(depth))
    return image
