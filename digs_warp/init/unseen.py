"""What a few views did not see of an object: points that close it.

A place outside a mask is empty, and so is one before a measured surface. The skin of what nothing rules out
lies between the unknown and the empty, and closes the holes between the measured parts (Curless and Levoy
1996, section 5). It is trimmed to the extent of the measured points: below an object that no view saw from
below, the masks rule out too little.
"""

from collections.abc import Sequence

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import Camera
from digs_warp.init.config import InitConfig
from digs_warp.init.hull import Hull, visual_hull
from digs_warp.init.view_points import map_frames, thinned
from digs_warp.init.visibility import DepthViews, hidden, not_seen_through

# Points of the shell: they lie about three degrees apart.
COUNT = 4000

# Radius of the shell, as a multiple of the distance within which this percentile of the points lie.
BEYOND, FAR_PERCENTILE = 1.5, 99.5

# A color is the mean over this many points in the nearest directions.
SHELL_NEIGHBORS = 32


def shell_points(points: PointCloud, cameras: Sequence[Camera]) -> PointCloud:
    """Return points on a sphere around the cameras, beyond the given points; always the same ones.

    Args:
        points: of the scene, at least one.
        cameras: of its views.
    """
    from scipy.spatial import KDTree  # pyright: ignore[reportAttributeAccessIssue]

    center = np.median([camera.center_world for camera in cameras], axis=0)
    offsets = points.points_world - center
    distances = np.linalg.norm(offsets, axis=1)
    radius = BEYOND * float(np.percentile(distances, FAR_PERCENTILE))
    directions = sphere(COUNT)
    seen = offsets / np.maximum(distances, 1e-9)[:, None]
    _, nearest = KDTree(seen).query(directions, k=min(SHELL_NEIGHBORS, len(points)))
    colors = points.colors[nearest.reshape(COUNT, -1)].mean(axis=1)
    return PointCloud(center + radius * directions, colors)


def sphere(count: int) -> np.ndarray:
    """Return unit vectors spread evenly over the sphere, a Fibonacci lattice, shape (count, 3)."""
    steps = np.arange(count) + 0.5
    height = 1.0 - 2.0 * steps / count
    turn = np.pi * (1.0 + 5.0**0.5) * steps
    across = np.sqrt(1.0 - height**2)
    return np.stack([across * np.cos(turn), across * np.sin(turn), height], axis=1)


# With more views than this around an object, what none of them saw is small and mostly below it.
FEW_VIEWS = 6

# Edge of a cell in voxels of the measured points, and how many edges away from them a cell is unseen.
CELL_VOXELS = 2.0
UNSEEN_EDGES = 2.5

# The extent of the measured points: along this many directions, without this share of stray points at both
# ends, and with this share of it added, for a back may bulge.
DIRECTIONS = 256
STRAYS = 0.005
BULGE = 0.05

# An unseen point has the mean color of this many measured ones.
NEIGHBORS = 16


def fills_unseen(frames: Sequence[Frame]) -> bool:
    """Return whether the object is closed where none of the training frames saw it."""
    return len(frames) <= FEW_VIEWS and all(frame.has(Layer.MASK) for frame in frames)


def unseen_points(
    frames: Sequence[Frame], measured: PointCloud, voxel_size: float, config: InitConfig
) -> PointCloud:
    """Return points that close the object; those that no view can see are marked as hidden.

    There are none where the masks enclose nothing, as with cameras that all look in the same direction.

    Args:
        frames: with image, depth and mask.
        measured: the points from their depth, at least one.
        voxel_size: of their grid [m].
        config: the settings.
    """
    from scipy.spatial import KDTree

    nothing = measured.select(np.zeros(len(measured), dtype=bool))
    try:
        hull = visual_hull(frames, config, CELL_VOXELS * voxel_size)
    except DigsError:  # says which masks are wrong; the measured points do without them
        return nothing
    views = DepthViews.of(list(map_frames(frames, _depth_of)))
    places, _ = _unknown(hull, measured.points_world, views, voxel_size).skin()
    neighbors = min(NEIGHBORS, len(measured))
    found = KDTree(measured.points_world).query(places, k=neighbors, workers=-1)
    distances, nearest = (np.reshape(each, (len(places), neighbors)) for each in found)
    far = distances[:, 0] > UNSEEN_EDGES * hull.edge
    places, colors = places[far], measured.colors[nearest[far]].mean(axis=1)
    return PointCloud(places, colors, hidden=hidden(places, views, voxel_size))


def _depth_of(frame: Frame) -> tuple[Camera, np.ndarray]:
    return frame.camera, thinned(frame.load_depth())


def _unknown(hull: Hull, measured: np.ndarray, views: DepthViews, voxel_size: float) -> Hull:
    """Return the cells that no depth rules out, and that are not beyond the measured points."""
    cells = np.argwhere(hull.inside)
    places = hull.place_of(cells)
    keep = not_seen_through(places, views, voxel_size) & _within(places, measured, hull.edge)
    inside = np.zeros_like(hull.inside)
    inside[tuple(cells[keep].T)] = True
    return Hull(hull.low, hull.edge, inside)


def _within(places: np.ndarray, measured: np.ndarray, slack: float) -> np.ndarray:
    """Return which places are within the extent of the measured points, give or take ``slack`` [m]."""
    directions = np.random.default_rng(0).normal(size=(DIRECTIONS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    keep = np.ones(len(places), dtype=bool)
    for direction in directions:
        low, high = np.quantile(measured @ direction, [STRAYS, 1 - STRAYS])
        keep[keep] = places[keep] @ direction <= high + BULGE * (high - low) + slack
    return keep
