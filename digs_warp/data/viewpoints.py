"""Some of many views, evenly spread, the point that they look at, and where up is."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.geometry.camera import Camera

Item = TypeVar("Item")


def evenly(items: Sequence[Item], count: int) -> list[Item]:
    """Return at most ``count`` of the items, evenly spread, in their order; the first is among them."""
    step = max(1.0, len(items) / count)
    return [items[int(i * step)] for i in range(min(count, len(items)))]


def spread(count: int, most: int) -> list[int]:
    """Return at most ``most`` numbers below ``count``, evenly spread, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(int)).tolist()


def looked_at(cameras: Sequence[Camera]) -> np.ndarray:
    """Return the point with the smallest summed squared distance to all optical axes [m], shape (3,).

    Raises:
        DigsError: all cameras look in the same direction.
    """
    axes = np.stack([camera.world_from_cam[:3, 2] for camera in cameras])
    centers = np.stack([camera.center_world for camera in cameras])
    # The distance of x to an axis is |(I - a a^T) (x - c)|: linear least squares.
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    normal_matrix = across.sum(axis=0)
    if np.linalg.cond(normal_matrix) > 1e6:
        raise DigsError(
            "all cameras look in the same direction, so there is no point that they all look at"
        )
    return np.linalg.solve(normal_matrix, np.einsum("nij,nj->i", across, centers))


def upward(cameras: Sequence[Camera]) -> np.ndarray | None:
    """Return where the tops of the images point on average, shape (3,): people hold cameras upright.

    None if the cameras are turned about their axes in all directions.
    """
    up = -np.mean([camera.world_from_cam[:3, 1] for camera in cameras], axis=0)
    length = float(np.linalg.norm(up))
    return up / length if length >= 0.1 else None
