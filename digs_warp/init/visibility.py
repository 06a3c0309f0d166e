"""Visibility across views: what removes floaters, an extension of the paper.

If a view measured depth d at the pixel of a point, it saw through everything nearer. The view contradicts a
point at depth z < d - tolerance, and confirms one within the tolerance. A point farther away is hidden, and
the view says nothing about it.

Views that disagree by a few voxels make a cloud several voxels thick. `onto_surface` moves its points to
where the views together measured the surface: the zero of the mean of their truncated signed distances
(Curless and Levoy 1996, section 3), each weighted by how little it differs and how straight it looks at the
surface. The points of a voxel then become one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import warp as wp

from digs_warp.device.eyes import Eye, eyes_of, pixel_seen, place_of, shows
from digs_warp.device.parallel import launch_parallel
from digs_warp.geometry.camera import Camera

wp.set_module_options({"enable_backward": False})

# Depths agree within this many voxels plus this share of the depth.
TOLERANCE_VOXELS = 2.0
TOLERANCE_SHARE = 0.01

# A view that measured the surface within the first number of voxels of a point agrees with it, and one that
# measured it within the second disagrees.
AGREES_VOXELS, NEAR_VOXELS = 1.0, 4.0

# A point this near to the surface stays [voxels]: its mean of many measurements is better than the nearest
# pixels of the views, and a cloud of one voxel is one layer.
STAYS = 0.4

_AGREES = wp.constant(wp.float64(AGREES_VOXELS))
_NEAR = wp.constant(wp.float64(NEAR_VOXELS))
_VOXELS = wp.constant(wp.float64(TOLERANCE_VOXELS))
_STAYS = wp.constant(wp.float64(STAYS))


@wp.func
def depths_at(eye: Eye, depth: wp.array[float], beside: float, point: wp.vec3d):
    """Depth [m] measured at the pixel of a point, and the point's own.

    A point outside of the image is as if infinitely far behind what was measured, that is, hidden, too; but
    seen through if ``beside`` is above 0.
    """
    seen = pixel_seen(eye, point)
    measured = wp.float64(beside)
    own = wp.where(beside > 0.0, wp.float64(0.0), wp.float64(wp.inf))
    if shows(eye, seen):
        measured = wp.float64(depth[place_of(eye, seen)])
        own = seen[2]
    return measured, own


@wp.kernel
def count_views_kernel(
    first: int,
    points: wp.array[wp.vec3d],  # [n] in the world [m]
    eyes: wp.array[Eye],
    depth: wp.array[float],  # depth maps of all eyes [m], NaN: unknown
    beside: wp.array[float],  # [eyes] as of `DepthViews`
    voxel_size: wp.float64,  # [m]
    share: wp.float64,  # of the depth
    # output
    counts: wp.array2d[int],  # [n, 5] as of `ViewCounts`
):
    """Count what the views say of a point."""
    i = first + wp.tid()
    confirmed = int(0)
    contradicted = int(0)
    occluded = int(0)
    agreeing = int(0)
    near = int(0)
    for e in range(eyes.shape[0]):
        measured, own = depths_at(eyes[e], depth, beside[e], points[i])
        nearer = measured - own
        tolerance = _VOXELS * voxel_size + share * measured
        # Comparisons with NaN, where nothing was measured, are False.
        if wp.abs(nearer) <= tolerance:
            confirmed += 1
        if nearer > tolerance:
            contradicted += 1
        if nearer < -tolerance:
            occluded += 1
        if wp.abs(nearer) <= _AGREES * voxel_size:
            agreeing += 1
        if wp.abs(nearer) <= _NEAR * voxel_size:
            near += 1
    counts[i, 0] = confirmed
    counts[i, 1] = contradicted
    counts[i, 2] = occluded
    counts[i, 3] = agreeing
    counts[i, 4] = near


@wp.func
def ray_to(eye: Eye, point: wp.vec3d, depth: wp.float64) -> wp.vec3d:
    """The way from a camera to a point, in the world, for one metre of planar depth."""
    seen = wp.transform_point(eye.cam_from_world, point)
    return wp.transform_vector(wp.transpose(eye.cam_from_world), seen / depth)


@wp.kernel
def onto_surface_kernel(
    first: int,
    points: wp.array[wp.vec3d],  # [n] in the world [m]
    eyes: wp.array[Eye],
    depth: wp.array[float],  # depth maps of all eyes [m], NaN: unknown
    beside: wp.array[float],  # [eyes] as of `DepthViews`
    voxel_size: wp.float64,  # [m]
    # output
    moved: wp.array[wp.vec3d],  # [n]
):
    """Move a point along its mean ray by the mean distance to what the views near it measured."""
    i = first + wp.tid()
    point = points[i]
    reach = _NEAR * voxel_size
    middle = wp.vec3d()
    near = wp.int64(0)  # a bit for each of the first 63 eyes, and one for the others
    for e in range(eyes.shape[0]):
        measured, own = depths_at(eyes[e], depth, beside[e], point)
        # Comparisons with NaN, where nothing was measured, are False.
        if wp.abs(measured - own) < reach:
            middle += wp.normalize(ray_to(eyes[e], point, own))
            near |= wp.int64(1) << wp.int64(wp.min(e, 63))
    middle = wp.normalize(middle)
    weights = wp.float64(0.0)
    distance = wp.float64(0.0)
    ray = wp.vec3d()
    for e in range(eyes.shape[0]):
        if (near >> wp.int64(wp.min(e, 63))) & wp.int64(1) == wp.int64(0):
            continue
        measured, own = depths_at(eyes[e], depth, beside[e], point)
        apart = measured - own
        if wp.abs(apart) < reach:
            toward = ray_to(eyes[e], point, own)
            facing = wp.max(wp.dot(wp.normalize(toward), middle), wp.float64(0.0))
            # The fourth power: near a silhouette the pixels beside a point lie behind it or before it, and
            # those behind are out of reach.
            square = facing * facing
            share = (wp.float64(1.0) - wp.abs(apart) / reach) * (square * square)
            weights += share
            distance += share * apart
            ray += share * toward
    if wp.abs(distance) > _STAYS * voxel_size * weights:
        point += (distance / weights) * (ray / weights)
    moved[i] = point


@dataclass(frozen=True, eq=False)
class DepthViews:
    """Views as the kernels look them up: cameras, and depth maps [m] one after the other.

    ``beside`` is the depth beside the image [m]: 0 hides what is there, more is seen through.
    """

    eyes: wp.array
    depth: wp.array
    beside: wp.array

    def __len__(self) -> int:
        return self.eyes.size

    @staticmethod
    def of(
        views: Sequence[tuple[Camera, np.ndarray]], beside: Sequence[float] = ()
    ) -> "DepthViews":
        """Pack cameras and their depth maps, (height, width) each, at the image's size or a reduced one."""
        flat = np.concatenate([np.zeros(0, np.float32), *(depth.reshape(-1) for _, depth in views)])
        return DepthViews(
            eyes_of([camera for camera, _ in views], [depth.shape for _, depth in views]),
            wp.array(flat.astype(np.float32, copy=False), dtype=float, device="cpu", copy=False),
            wp.array(beside or [0.0] * len(views), dtype=float, device="cpu"),
        )


class ViewCounts(NamedTuple):
    """How many views say what of each point, (n,) each, int32.

    Attributes:
        confirmed, contradicted, occluded: measured the surface there; farther away; nearer, or do not show
            it.
        agreeing, near: measured the surface within `AGREES_VOXELS` and `NEAR_VOXELS` of it.
    """

    confirmed: np.ndarray
    contradicted: np.ndarray
    occluded: np.ndarray
    agreeing: np.ndarray
    near: np.ndarray


def count_views(
    points_world: np.ndarray,
    views: DepthViews,
    voxel_size: float,
    share: float = TOLERANCE_SHARE,
) -> ViewCounts:
    """Return what the views say of points.

    Args:
        points_world: points [m], shape (n, 3).
        views: all of them.
        voxel_size: of the points' grid [m].
        share: of the depth, added to the tolerance of `TOLERANCE_VOXELS`.
    """
    found = wp.empty((len(points_world), 5), dtype=int, device="cpu")
    inputs = [*_inputs(points_world, views, voxel_size), wp.float64(share), found]
    launch_parallel(count_views_kernel, len(points_world), inputs)
    return ViewCounts(*found.numpy().T)


def not_seen_through(points_world: np.ndarray, views: DepthViews, voxel_size: float) -> np.ndarray:
    """Return the points that at least as many views confirm as contradict, shape (n,), bool."""
    counts = count_views(points_world, views, voxel_size)
    return counts.confirmed >= counts.contradicted


def hidden(points_world: np.ndarray, views: DepthViews, voxel_size: float) -> np.ndarray:
    """Return which points no view can see, (n,), bool: behind what it measured, or not in its image."""
    return count_views(points_world, views, voxel_size).occluded == len(views)


def agreement_of_views(
    points_world: np.ndarray, views: DepthViews, voxel_size: float
) -> np.ndarray:
    """Return the share of views that agree with each point, (n,), float32; 1 where none says anything.

    Of the views that measured the surface within `NEAR_VOXELS` in front of a point or behind it, those agree
    that measured it within `AGREES_VOXELS`. Exact depth gives nearly 1; where views contradict each other, a
    cloud is several voxels thick, and its outer points get the least.
    """
    counts = count_views(points_world, views, voxel_size)
    share = counts.agreeing / np.maximum(counts.near, 1)
    return np.where(counts.near > 0, share, 1.0).astype(np.float32)


def onto_surface(points_world: np.ndarray, views: DepthViews, voxel_size: float) -> np.ndarray:
    """Return points moved to where the views that measured something near them put the surface [m], (n, 3).

    Views count whose depth is within `NEAR_VOXELS` of the point. Arguments as of `count_views`.
    """
    moved = wp.empty(len(points_world), dtype=wp.vec3d, device="cpu")
    inputs = [*_inputs(points_world, views, voxel_size), moved]
    launch_parallel(onto_surface_kernel, len(points_world), inputs)
    return moved.numpy()


def _inputs(points_world: np.ndarray, views: DepthViews, voxel_size: float) -> list[Any]:
    """Return what both kernels read."""
    points = wp.array(np.asarray(points_world, np.float64), dtype=wp.vec3d, device="cpu")
    return [points, views.eyes, views.depth, views.beside, wp.float64(voxel_size)]


# Points with fewer than this many within this many times the distance between points, themselves included,
# are outliers.
MIN_CLUSTER, REACH = 4, 12.0


def not_isolated(points_world: np.ndarray) -> np.ndarray:
    """Return which points (n, 3) have others around them, shape (n,), bool; all if none has.

    A surface, however thin, is a chain of points; an outlier has next to nothing around it.
    """
    from scipy.spatial import KDTree

    count = len(points_world)
    if count < MIN_CLUSTER:
        return np.ones(count, dtype=bool)
    tree = KDTree(points_world)
    apart, _ = tree.query(points_world, k=MIN_CLUSTER, workers=-1)
    keep = apart[:, -1] <= REACH * np.median(apart[:, 1])
    return keep if keep.any() else np.ones(count, dtype=bool)
