"""The far shell around a scene."""

import numpy as np

from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.init.unseen import shell_points

# Four walls of a room around the origin, each of one color; floor and ceiling are missing.
COLORS = {(1, 0): (1.0, 0, 0), (-1, 0): (0, 1.0, 0), (0, 1): (0, 0, 1.0), (0, -1): (1.0, 1.0, 0)}


def room() -> PointCloud:
    steps = np.linspace(-2, 2, 81)
    along, height = (each.reshape(-1) for each in np.meshgrid(steps, 0.25 * steps))
    walls, colors = [], []
    for (x, y), color in COLORS.items():
        side = np.stack([2 * x + y * along, 2 * y + x * along, height], axis=1)
        walls.append(side)
        colors.append(np.tile(color, (len(side), 1)))
    return PointCloud(np.concatenate(walls), np.concatenate(colors))


def camera(direction: np.ndarray) -> Camera:
    up = np.array([0.1, 0, 1.0])
    return Camera(Intrinsics.from_fov(32, 32, 60.0), look_at(np.zeros(3), direction, up))


def test_the_shell_lies_beyond_all_points_and_has_the_colors_of_the_walls() -> None:
    points = room()
    shell = shell_points(points, [camera(np.array([1.0, 0, 0]))])
    radii = np.linalg.norm(shell.points_world, axis=1)
    assert radii.min() > np.linalg.norm(points.points_world, axis=1).max()
    for (x, y), color in COLORS.items():
        toward = shell.points_world @ np.array([x, y, 0]) > 0.9 * radii
        np.testing.assert_allclose(shell.colors[toward].mean(axis=0), color, atol=0.05)
