"""What no view saw: the back of a ball that cameras on one side measure, and the far shell around a scene."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.frame import Frame
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initialize
from digs_warp.init.unseen import FEW_VIEWS, shell_points
from reference.ball_capture import RADIUS, ball_view, ball_views, write_capture

SIZE = 0.02
CLOSED = InitConfig(voxel_size=SIZE)


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> list[Frame]:
    """Three views from within a right angle."""
    views = [ball_view(angle) for angle in (0.0, np.pi / 4, np.pi / 2)]
    return list(write_capture(tmp_path_factory.mktemp("ball"), views).frames)


def largest_gap(points: PointCloud) -> float:
    """Return the widest angle between a direction and the nearest point as seen from the middle [degrees]."""
    directions = np.random.default_rng(0).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    found = points.points_world / np.linalg.norm(points.points_world, axis=1, keepdims=True)
    return float(np.degrees(np.arccos((directions @ found.T).max(axis=1).min())))


def test_points_close_the_ball_and_only_the_back_is_hidden(
    frames: list[Frame], tmp_path: Path
) -> None:
    start = initialize(frames, CLOSED)
    points = start.points
    assert start.sources["depth"] + start.sources["unseen"] == len(points)
    assert "closed where no view saw the object" in start.because
    assert largest_gap(points.select(np.arange(start.sources["depth"]))) > 60
    assert largest_gap(points) < 35  # below, where only the extent of the measured points bounds it
    assert points.hidden is not None
    points.save(tmp_path / "points.npz")
    np.testing.assert_array_equal(PointCloud.load(tmp_path / "points.npz").hidden, points.hidden)
    measured, unseen = np.split(points.colors, [start.sources["depth"]])  # those around
    assert (unseen >= measured.min(axis=0)).all() and (unseen <= measured.max(axis=0)).all()
    hidden = points.points_world[points.hidden]
    assert len(hidden) > 0.8 * start.sources["unseen"]
    for frame in frames:  # the way to each camera leads through the ball
        eye = frame.camera.center_world
        way = (hidden - eye) / np.linalg.norm(hidden - eye, axis=1, keepdims=True)
        assert (np.linalg.norm(eye - (way @ eye)[:, None] * way, axis=1) < RADIUS).all()


def test_nothing_is_put_before_a_measured_surface_or_far_beyond_it(frames: list[Frame]) -> None:
    start = initialize(frames, CLOSED)
    unseen = start.points.points_world[start.sources["depth"] :]
    for frame in frames:
        px, z = frame.camera.project(unseen)
        columns, rows = np.floor(px).astype(int).T
        assert (z > frame.load_depth()[rows, columns] - 3 * SIZE).all()
    assert np.linalg.norm(unseen, axis=1).max() < 1.6 * RADIUS


@pytest.mark.parametrize("count", [3, FEW_VIEWS + 1])
def test_few_views_are_filled_and_many_are_not(count: int, tmp_path: Path) -> None:
    frames = write_capture(tmp_path, ball_views(40)[:count]).frames
    sources = initialize(frames, InitConfig(voxel_size=SIZE)).sources
    assert ("unseen" in sources) == (count == 3)


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
