"""The motion between two frames by their color and depth, and how well the frames agree under a motion."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.device.libraries import import_open3d
from digs_warp.geometry import invert_rigid, matrix_from_rotation_vector, rigid
from digs_warp.poses.align import align
from digs_warp.poses.views import Picture

# A hand that walks round something turns the camera about what it sees, by up to this [degree].
TURNS = (-14.0, -7.0, 7.0, 14.0)
# Steps of the odometry at each size, from the smallest image.
ODOMETRY_STEPS = (20, 15, 10)
# Depths that differ by more than this share of the usual distance belong to different surfaces.
SAME_SURFACE = 0.05
# Farther than this many usual distances, depth is too noisy to place a camera.
FARTHEST = 3.0
# Points of a frame that are looked up in another.
SAMPLES = 700
# Differences that count as a whole one: of depth (a share of it) and of brightness (0..1).
OTHER_DEPTH, OTHER_BRIGHTNESS = 0.06, 0.1
# What a point counts that the other frame does not see: less than one that contradicts it in both.
UNSEEN = 1.2


@dataclass(frozen=True, eq=False)
class Edge:
    """A measured motion between two frames.

    Attributes:
        source: number of the first frame.
        target: number of the second.
        target_from_source: (4, 4), metres.
        information: of the motion, (6, 6), rotation first, as Open3D's pose graphs have it.
        disagreement: of the frames under it, 0 to 2; see `disagreement`.
    """

    source: int
    target: int
    target_from_source: np.ndarray
    information: np.ndarray
    disagreement: float


def usual_distance(picture: Picture) -> float:
    """Return the harmonic mean of the depth [m]: near things place a camera best."""
    return float(1 / np.nanmean(1 / picture.depth))


def starts_for(picture: Picture, before: np.ndarray) -> list[np.ndarray]:
    """Return motions to start from: none, the one ``before`` (4, 4), and turns about what the camera sees."""
    k = picture.intrinsics
    middle = picture.depth[k.height // 4 : -k.height // 4, k.width // 4 : -k.width // 4]
    inner = middle if np.isfinite(middle).any() else picture.depth
    pivot = np.array([0.0, 0.0, 1 / np.nanmean(1 / inner)])
    turns = [matrix_from_rotation_vector(np.array([0.0, np.radians(a), 0.0])) for a in TURNS]
    return [np.eye(4), before, *(rigid(turn, pivot - turn @ pivot) for turn in turns)]


def edge_between(
    pictures: Sequence[Picture], source: int, target: int, starts: Sequence[np.ndarray]
) -> Edge:
    """Return the motion under which two frames agree best.

    From every start: Open3D's odometry (color and depth together; Park et al., "Colored point
    cloud registration revisited", ICCV 2017), then the package's own alignment, which knows that the noise of
    depth grows with distance.

    Args:
        pictures: of the recording; both frames have depth.
        source: number of a frame.
        target: number of another.
        starts: ``target_from_source`` to begin with, (4, 4) each.
    """
    first, second = pictures[source], pictures[target]
    found: list[Edge] = []
    for start in starts:
        moved, information = _odometry(first, second, start)
        # Where little holds it, the odometry runs away.
        best = min((start, moved), key=lambda motion: disagreement(first, second, motion))
        for motion in (moved, _aligned(first, second, best)):
            apart = disagreement(first, second, motion)
            found.append(Edge(source, target, motion, information, apart))
    return min(found, key=lambda edge: edge.disagreement)


def disagreement(first: Picture, second: Picture, second_from_first: np.ndarray) -> float:
    """Return how much two frames contradict each other under a motion: 0 nothing, 1.2 nothing shared.

    The mean over points of the larger of both directions; near points count more. Every point adds its
    difference of depth and of brightness, each at most 1.
    """
    there = _one_way(first, second, second_from_first)
    return max(there, _one_way(second, first, invert_rigid(second_from_first)))


def _one_way(first: Picture, second: Picture, motion: np.ndarray) -> float:
    known = np.argwhere(np.isfinite(first.depth))
    rows, columns = known[:: max(1, len(known) // SAMPLES)].T
    k, z = first.intrinsics, first.depth[rows, columns].astype(np.float64)
    points = np.stack(
        [(columns + 0.5 - k.cx) / k.fx * z, (rows + 0.5 - k.cy) / k.fy * z, z], axis=1
    )
    x, y, depth = (points @ motion[:3, :3].T + motion[:3, 3]).T
    k = second.intrinsics
    ahead = depth > 0
    safe = np.where(ahead, depth, 1.0)
    u, v = x / safe * k.fx + k.cx, y / safe * k.fy + k.cy
    inside = ahead & (u >= 0) & (u < k.width) & (v >= 0) & (v < k.height)
    column, row = (np.where(inside, each, 0).astype(np.intp) for each in (u, v))
    apart = np.abs(second.depth[row, column] - depth) / safe / OTHER_DEPTH
    darker = np.abs(second.brightness[row, column] - first.brightness[rows, columns])
    seen = inside & np.isfinite(apart)
    each = np.minimum(apart, 1) + np.minimum(darker / OTHER_BRIGHTNESS, 1)
    return float(np.average(np.where(seen, each, UNSEEN), weights=1 / z))


def _aligned(first: Picture, second: Picture, motion: np.ndarray) -> np.ndarray:
    """Return the motion after `align` of the two; the same where they have nothing in common."""
    found = align([first, second], np.stack([np.eye(4), invert_rigid(motion)]))
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
