"""Visibility across views: an extension of the paper that removes floaters, and tells how sure points are.

If a view measured depth d at the pixel of a point, it saw through everything nearer. The view contradicts a
point at depth z < d - tolerance, and confirms one within the tolerance. A point farther away is hidden, and
the view says nothing about it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import warp as wp

from digs_warp.device.eyes import eyes_of
from digs_warp.device.parallel import launch_parallel
from digs_warp.geometry.camera import Camera
from digs_warp.init.visibility_kernel import agreement_kernel, says_kernel


@dataclass(frozen=True, eq=False)
class DepthViews:
    """Views as the kernels look them up: cameras, and depth maps [m] one after the other."""

    eyes: wp.array
    depth: wp.array

    def __len__(self) -> int:
        return self.eyes.size

    @staticmethod
    def of(views: Sequence[tuple[Camera, np.ndarray]]) -> "DepthViews":
        """Pack cameras and their depth maps, (height, width) each, at the image's size or a reduced one."""
        flat = np.concatenate([np.zeros(0, np.float32), *(depth.reshape(-1) for _, depth in views)])
        return DepthViews(
            eyes_of([camera for camera, _ in views], [depth.shape for _, depth in views]),
            wp.array(flat.astype(np.float32, copy=False), dtype=float, device="cpu", copy=False),
        )


class Said(NamedTuple):
    """How many views say what about each point, (n,) each, int32."""

    confirmed: np.ndarray
    contradicted: np.ndarray
    blind: np.ndarray


def not_seen_through(points_world: np.ndarray, views: DepthViews, voxel_size: float) -> np.ndarray:
    """Return the points that at least as many views confirm as contradict, shape (n,), bool.

    Args:
        points_world: points [m], shape (n, 3).
        views: all of them.
        voxel_size: of the points' grid [m].
    """
    said = what_views_say(points_world, views, voxel_size)
    return said.confirmed >= said.contradicted


def confirmed(points_world: np.ndarray, views: DepthViews, voxel_size: float) -> np.ndarray:
    """Return which points a view confirms, (n,), bool; arguments as of `not_seen_through`."""
    return what_views_say(points_world, views, voxel_size).confirmed > 0


def hidden(points_world: np.ndarray, views: DepthViews, voxel_size: float) -> np.ndarray:
    """Return which points no view can see, (n,), bool: behind what it measured, or not in its image.

    Arguments as of `not_seen_through`.
    """
    return what_views_say(points_world, views, voxel_size).blind == len(views)


def agreement_of_views(
    points_world: np.ndarray, views: DepthViews, voxel_size: float
) -> np.ndarray:
    """Return the share of views that agree with each point, (n,), float32; 1 where none says anything.

    Of the views that measured the surface within `NEAR_VOXELS` in front of a point or behind it, those agree
    that measured it within `AGREES_VOXELS`. Exact depth gives nearly 1; where views contradict each other, a
    cloud is several voxels thick, and its outer points get the least. Arguments as of `not_seen_through`.
    """
    agreement = wp.empty(len(points_world), dtype=float, device="cpu")
    inputs = [*_inputs(points_world, views, voxel_size), agreement]
    launch_parallel(agreement_kernel, len(points_world), inputs)
    return agreement.numpy()


def what_views_say(points_world: np.ndarray, views: DepthViews, voxel_size: float) -> Said:
    """Return how many views confirm, contradict, and cannot see each point."""
    count = len(points_world)
    found = wp.empty((count, 3), dtype=int, device="cpu")
    launch_parallel(says_kernel, count, [*_inputs(points_world, views, voxel_size), found])
    return Said(*found.numpy().T)


def _inputs(points_world: np.ndarray, views: DepthViews, voxel_size: float) -> list[Any]:
    """Return what both kernels read."""
    points = wp.array(np.asarray(points_world, np.float64), dtype=wp.vec3d, device="cpu")
    return [points, views.eyes, views.depth, wp.float64(voxel_size)]
