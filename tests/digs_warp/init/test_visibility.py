"""What views say about points and in which colors, against plain NumPy; and what no view saw."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initialize
from digs_warp.init.seen_colors import colors_in
from digs_warp.init.unseen import FEW_VIEWS, shell_points
from digs_warp.init.visibility import (
    DepthViews,
    agreement_of_views,
    count_views,
    hidden,
    not_seen_through,
)
from reference.ball_capture import RADIUS, ball_view, ball_views, write_capture


def colors_seen(points_world: np.ndarray, frame: Frame) -> np.ndarray:
    """Return the mean sRGB color of 3x3 pixels around each point, (n, 3), NaN where it is not seen."""
    image = frame.load_image()
    mask = frame.load_mask() if frame.has(Layer.MASK) else np.full(image.shape[:2], 255, np.uint8)
    depth = frame.load_depth() if frame.has(Layer.DEPTH) else None
    height, width = image.shape[:2]
    found = np.full((len(points_world), 3), np.nan)
    nearest: dict[tuple[int, int], float] = {}  # of the points in squares of 4 pixels
    for (u, v), z in zip(*frame.camera.project(points_world), strict=True):
        if z > 0 and 0 <= u < width and 0 <= v < height:
            nearest[int(v) // 4, int(u) // 4] = min(z, nearest.get((int(v) // 4, int(u) // 4), z))
    for i, ((u, v), z) in enumerate(zip(*frame.camera.project(points_world), strict=True)):
        if not (z > 0 and 1 <= np.floor(u) < width - 1 and 1 <= np.floor(v) < height - 1):
            continue
        row, column = int(v), int(u)
        if depth is not None and not abs(float(depth[row, column]) - z) <= 0.015 * z:
            continue
        if depth is None and z > 1.015 * nearest[row // 4, column // 4]:
            continue
        block = np.s_[row - 1 : row + 2, column - 1 : column + 2]
        if (mask[block] == 255).all():
            found[i] = (image[block].reshape(9, 3) / 255.0).mean(axis=0)
    return found


def agreement_by(
    points_world: np.ndarray, views: Sequence[tuple[Camera, np.ndarray]], voxel_size: float
) -> np.ndarray:
    """Return the share of the views that measured the surface near a point and agree with it, (n,)."""
    measured, own = _compared(points_world, views)
    agreeing, near = (
        (np.abs(measured - own) <= limit * voxel_size).sum(axis=0) for limit in (1, 4)
    )
    return np.where(near > 0, agreeing / np.maximum(near, 1), 1.0)


def said_by(
    points_world: np.ndarray,
    views: Sequence[tuple[Camera, np.ndarray]],
    voxel_size: float,
    whole: Sequence[bool],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return how many views confirm, contradict and cannot see each point, (n,) each.

    What lies beside the image of a view that shows all of the object is seen through.
    """
    measured, own = _compared(points_world, views)
    beyond = (measured - own) / (2 * voxel_size + 0.01 * measured)
    through = np.isnan(own) & np.array(whole)[:, None]
    said = np.abs(beyond) <= 1, (beyond > 1) | through, (np.isnan(own) & ~through) | (beyond < -1)
    return said[0].sum(axis=0), said[1].sum(axis=0), said[2].sum(axis=0)


def _compared(
    points_world: np.ndarray, views: Sequence[tuple[Camera, np.ndarray]]
) -> tuple[np.ndarray, np.ndarray]:
    """Return what each view measured at each point, and its depth there; NaN outside, (views, n) each."""
    found = np.full((2, len(views), len(points_world)), np.nan)
    for i, (camera, depth) in enumerate(views):
        height, width = depth.shape
        px, z = camera.resized(width, height).project(points_world)
        seen = (z > 0) & (px >= 0).all(axis=1) & (px < [width, height]).all(axis=1)
        columns, rows = px[seen].astype(int).T
        found[0, i, seen], found[1, i, seen] = depth[rows, columns], z[seen]
    return found[0], found[1]


VOXEL = 0.01


def views_with_holes(count: int) -> list[tuple[Camera, np.ndarray]]:
    """Return views of a ball, the depth of the odd ones at half the size, a tenth of it unknown."""
    rng = np.random.default_rng(1)
    views = []
    for number, (camera, images) in enumerate(ball_views(count)):
        step = 1 + number % 2
        depth = images.depth[::step, ::step].copy()
        depth[rng.random(depth.shape) < 0.1] = np.nan
        views.append((camera, depth))
    return views


def points_around(count: int, farthest: float = 6.0) -> np.ndarray:
    """Points on the ball, in front of it, inside it, behind the cameras, and far away in no image."""
    rng = np.random.default_rng(2)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return (
        directions
        * RADIUS
        * rng.uniform(0.5, farthest, (count, 1)) ** rng.integers(0, 2, (count, 1))
    )


@pytest.mark.parametrize("whole", [(False,) * 5, (True, False, True, False, True)])
def test_views_say_what_the_twin_says(whole: tuple[bool, ...]) -> None:
    points, views = points_around(400), views_with_holes(5)
    found, expected = (
        count_views(points, DepthViews.of(views, [1e6 * each for each in whole]), VOXEL),
        said_by(points, views, VOXEL, whole),
    )
    for name, counts in zip(found._fields, expected, strict=False):
        np.testing.assert_array_equal(getattr(found, name), counts, err_msg=name)
        assert 0 < counts.sum() < len(points) * len(views), name


def test_views_agree_with_the_points_that_the_twin_says() -> None:
    points, views = points_around(400), views_with_holes(5)
    found = agreement_of_views(points, DepthViews.of(views), VOXEL)
    np.testing.assert_allclose(found, agreement_by(points, views, VOXEL), rtol=1e-6)
    assert ((found > 0) & (found < 1)).any()


def test_a_point_is_seen_hidden_or_seen_through() -> None:
    camera, images = ball_views(1)[0]
    view = (camera, images.depth)
    toward = camera.center_world / np.linalg.norm(camera.center_world)
    points = np.stack([RADIUS * toward, -RADIUS * toward, 1.5 * RADIUS * toward])
    assert count_views(points, DepthViews.of([view]), VOXEL).confirmed.tolist() == [1, 0, 0]
    assert hidden(points, DepthViews.of([view]), VOXEL).tolist() == [False, True, False]
    assert not_seen_through(points, DepthViews.of([view]), VOXEL).tolist() == [True, True, False]


def test_nobody_contradicts_without_views_or_depth() -> None:
    points, (camera, depth) = points_around(20), views_with_holes(1)[0]
    assert not_seen_through(points, DepthViews.of([]), VOXEL).all()
    assert hidden(points, DepthViews.of([]), VOXEL).all()
    assert (agreement_of_views(points, DepthViews.of([]), VOXEL) == 1).all()
    unknown = np.full_like(depth, np.nan)
    assert not_seen_through(points, DepthViews.of([(camera, unknown)]), VOXEL).all()
    assert (agreement_of_views(points, DepthViews.of([(camera, unknown)]), VOXEL) == 1).all()
    nothing = np.zeros((0, 3))
    assert len(count_views(nothing, DepthViews.of([(camera, depth)]), VOXEL).occluded) == 0
    assert len(agreement_of_views(nothing, DepthViews.of([(camera, depth)]), VOXEL)) == 0
    turned = replace(camera, world_from_cam=camera.world_from_cam @ np.diag([1.0, -1.0, -1.0, 1.0]))
    assert hidden(points_around(20) * 0.1, DepthViews.of([(turned, depth)]), VOXEL).all()


def test_floaters_before_the_object_are_removed(tmp_path: Path) -> None:
    """One view reports a patch of the object much too near; all others see through it."""
    views = ball_views(12)
    views[0][1].depth[25:35, 35:45] = 0.5
    capture = write_capture(tmp_path, views)
    points = initialize(capture.frames, InitConfig(edge_filter=False)).points.points_world
    assert np.linalg.norm(points, axis=1).max() < RADIUS + 0.005
    assert len(points) > 1000


@pytest.mark.parametrize("cut", [False, True])
def test_a_wall_that_views_took_for_the_object_is_not_where_whole_silhouettes_are(
    tmp_path: Path, cut: bool
) -> None:
    """Two neighbors measured the wall inside of their masks, as behind thin rods; others look elsewhere."""
    views = ball_views(12)
    for _, images in views[:2]:
        images.depth[images.mask > 0] = 3.0
    if cut:
        for _, images in views:
            images.mask[:, 0] = 255
    points = initialize(write_capture(tmp_path, views).frames, InitConfig()).points.points_world
    assert (np.linalg.norm(points, axis=1).max() > 1.0) == cut
    assert len(points) > 1000


@pytest.mark.parametrize("without", [(), (Layer.MASK,), (Layer.DEPTH,), (Layer.MASK, Layer.DEPTH)])
def test_colors_are_those_of_the_twin(tmp_path: Path, without: tuple[Layer, ...]) -> None:
    views = ball_views(3)
    for _, images in views:
        images.depth[np.random.default_rng(1).random(images.depth.shape) < 0.1] = np.nan
    points = points_around(600, 9.0)
    for frame in write_capture(tmp_path, views).frames:
        for layer in without:
            frame = frame.without_layer(layer)
        found, expected = colors_in(points, frame, points), colors_seen(points, frame)
        np.testing.assert_allclose(found, expected, rtol=1e-14)
        assert 0 < np.isfinite(found[:, 0]).sum() < len(points)


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
