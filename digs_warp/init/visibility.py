"""Visibility across views: an extension of the paper that removes floaters in front of the object.

If a view measured depth d at the pixel of a point, it saw through everything nearer. The view contradicts a
point at depth z < d - tolerance, and confirms one within the tolerance. A point farther away is hidden, and
the view says nothing about it.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np

from digs_warp.camera import Camera
from digs_warp.device.parallel import default_threads

# Depths agree within this many voxels plus this share of the depth.
TOLERANCE_VOXELS = 2.0
TOLERANCE_SHARE = 0.01


def not_seen_through(
    points_world: np.ndarray, views: Sequence[tuple[Camera, np.ndarray]], voxel_size: float
) -> np.ndarray:
    """Return the points that at least as many views confirm as contradict, shape (n,), bool.

    Args:
        points_world: points [m], shape (n, 3).
        views: cameras and their depth maps [m], each (height, width), at the same or a reduced size.
        voxel_size: of the points' grid [m].
    """
    vote = partial(votes, points_world, voxel_size)
    with ThreadPoolExecutor(default_threads()) as pool:
        balance = sum(pool.map(vote, views), np.zeros(len(points_world), dtype=np.int64))
    return balance >= 0


def votes(
    points_world: np.ndarray, voxel_size: float, view: tuple[Camera, np.ndarray]
) -> np.ndarray:
    """Return +1 for points that the view confirms, -1 for those it contradicts, else 0.

    Args:
        points_world: points [m], shape (n, 3).
        voxel_size: of the points' grid [m].
        view: a camera and its depth map [m], as in `not_seen_through`.
    """
    inside, nearer, tolerance = _before_measured(points_world, voxel_size, view)
    found = np.zeros(len(points_world), dtype=np.int64)
    # Comparisons with NaN, where nothing was measured, are False.
    found[inside] = (np.abs(nearer) <= tolerance).astype(np.int64) - (nearer > tolerance)
    return found


def hidden(
    points_world: np.ndarray, voxel_size: float, view: tuple[Camera, np.ndarray]
) -> np.ndarray:
    """Return which points the view cannot see, (n,), bool: behind what it measured, or not in its image.

    Args:
        points_world: points [m], shape (n, 3).
        voxel_size: of the points' grid [m].
        view: a camera and its depth map [m], as in `not_seen_through`.
    """
    inside, nearer, tolerance = _before_measured(points_world, voxel_size, view)
    found = np.ones(len(points_world), dtype=bool)
    found[inside] = nearer < -tolerance
    return found


def _before_measured(
    points_world: np.ndarray, voxel_size: float, view: tuple[Camera, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which points the image shows, and for those: how far before the surface, and the tolerance."""
    camera, depth = view
    height, width = depth.shape
    camera = camera.resized(width, height)
    px, z = camera.project(points_world)
    inside = camera.shows(px, z)
    columns, rows = np.floor(px[inside]).astype(np.int64).T
    measured = depth[rows, columns].astype(np.float64)
    tolerance = TOLERANCE_VOXELS * voxel_size + TOLERANCE_SHARE * measured
    return inside, measured - z[inside], tolerance
