"""A far shell around a scene: what no view measured still shows a likely color there.

Rays that leave the measured surfaces, past their edges or through gaps, would show the background color. They
end on a sphere beyond all points instead. Its colors are those of the points in about the same direction.
"""

from collections.abc import Sequence

import numpy as np

from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import Camera

# Points of the shell: they lie about three degrees apart.
COUNT = 4000

# Radius of the shell, as a multiple of the distance within which this percentile of the points lie.
BEYOND, FAR_PERCENTILE = 1.5, 99.5

# A color is the mean over this many points in the nearest directions.
NEIGHBORS = 32


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
    _, nearest = KDTree(seen).query(directions, k=min(NEIGHBORS, len(points)))
    colors = points.colors[nearest.reshape(COUNT, -1)].mean(axis=1)
    axes = deviations = None
    if points.axes_world is not None:
        axes, deviations = directions, np.full(COUNT, 0.01 * radius)
    return PointCloud(center + radius * directions, colors, axes, deviations)


def sphere(count: int) -> np.ndarray:
    """Return unit vectors spread evenly over the sphere, a Fibonacci lattice, shape (count, 3)."""
    steps = np.arange(count) + 0.5
    height = 1.0 - 2.0 * steps / count
    turn = np.pi * (1.0 + 5.0**0.5) * steps
    across = np.sqrt(1.0 - height**2)
    return np.stack([across * np.cos(turn), across * np.sin(turn), height], axis=1)
