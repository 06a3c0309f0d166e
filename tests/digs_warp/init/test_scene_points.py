"""Points of a whole scene: a ball in a large sphere, without masks."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree  # pyright: ignore[reportAttributeAccessIssue]

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.config import InitConfig
from digs_warp.init.depth_points import NoPointsError, depth_points
from digs_warp.init.start import DepthReport
from reference.ball_capture import INTRINSICS, RADIUS, WALL_RADIUS, View, ball_views, write_capture

# The ball's rim is a depth jump in every view: a filter takes more of such small images than of photographs.
CONFIG = InitConfig(edge_filter=False)


def scene_points(
    frames: Sequence[Frame], config: InitConfig = CONFIG
) -> tuple[PointCloud, DepthReport]:
    return depth_points(frames, config, subject="scene")


# Rows and columns in which a view measures nothing.
HOLE = (slice(0, 9), slice(0, 30))


@pytest.fixture(scope="module")
def views() -> list[View]:
    return ball_views()


@pytest.fixture(scope="module")
def frames(views: list[View], tmp_path_factory: pytest.TempPathFactory) -> tuple[Frame, ...]:
    return write_capture(tmp_path_factory.mktemp("ball"), views).frames


@pytest.fixture(scope="module")
def found(frames: tuple[Frame, ...]) -> tuple[PointCloud, DepthReport]:
    return scene_points(frames)


def radii(points: PointCloud) -> np.ndarray:
    return np.linalg.norm(points.points_world, axis=1)


def guesses_of(points: PointCloud) -> np.ndarray:
    assert points.guessed is not None
    return points.points_world[points.guessed]


def changed_depth(frame: Frame, change: Callable[[np.ndarray], None]) -> Frame:
    depth = frame.load_depth()
    change(depth)
    return frame.with_layer(Layer.DEPTH, depth)


def with_hole(frame: Frame) -> Frame:
    def clear(depth: np.ndarray) -> None:
        depth[HOLE] = np.nan

    return changed_depth(frame, clear)


def test_points_lie_on_the_ball_and_on_the_surround(found: tuple[PointCloud, DepthReport]) -> None:
    points, report = found
    near, far = radii(points) < 1, radii(points) >= 1
    # The mean of surface points in a voxel lies below the surface by its sagitta at most.
    edge = report.voxel_size
    assert np.abs(radii(points)[near] - RADIUS).max() < 3 * (2 * edge) ** 2 / 8 / RADIUS + 1e-4
    # On the surround a voxel is four to eight times as large.
    assert np.abs(radii(points)[far] - WALL_RADIUS).max() < 3 * (8 * edge) ** 2 / 8 / WALL_RADIUS
    assert near.sum() > 200 and far.sum() > 1000
    assert report.pixels["with depth"] == 8 * 80 * 60


def test_voxels_are_as_wide_as_two_pixels_near_and_far(
    found: tuple[PointCloud, DepthReport],
) -> None:
    points, _ = found
    for distance, where in ((0.75, radii(points) < 1), (3.6, radii(points) >= 1)):
        some = points.points_world[where]
        apart = np.median(KDTree(some).query(some, k=2)[0][:, 1])
        two_pixels = 2 * distance / INTRINSICS.fx
        assert 0.4 * two_pixels < apart < 1.5 * two_pixels


def test_what_no_view_measured_gets_the_depth_of_its_neighbors(frames: tuple[Frame, ...]) -> None:
    # The upper left corner of every view shows surround that no other view shows.
    holed = [with_hole(frame) for frame in frames]
    points, report = scene_points(holed)
    guessed = guesses_of(points)
    assert len(guessed) == report.voxels["guessed"] > 30
    px, depth = frames[0].camera.project(guessed)
    inside = (depth > 0) & np.all((px > 0) & (px < [30, 9]), axis=1)
    assert inside.sum() > 10
    # The surround's depth changes by less than 10 % towards the corner.
    assert np.linalg.norm(guessed, axis=1)[inside] == pytest.approx(WALL_RADIUS, rel=0.15)


def test_a_guess_that_other_views_see_through_is_dropped(frames: tuple[Frame, ...]) -> None:
    """A view that measured only the ball puts the whole surround at the ball's depth."""

    def only_ball(depth: np.ndarray) -> None:
        depth[depth > 1.5] = np.nan

    points, _ = scene_points([changed_depth(frames[0], only_ball), *frames[1:]])
    in_the_air = (radii(points) > 1.2 * RADIUS) & (radii(points) < 0.8 * WALL_RADIUS)
    assert np.mean(in_the_air) < 0.01  # more than .02 without a look at the other views
    # Views agree with exact depth; where nobody looks, points are as sure as before.
    assert points.agreement is not None and np.median(points.agreement) > 0.8


def test_the_edge_filter_keeps_a_receding_floor_and_drops_the_balls_rim(
    frames: tuple[Frame, ...],
) -> None:
    points, report = scene_points(frames, replace(CONFIG, edge_filter=True))
    share = report.pixels["away from edges"] / report.pixels["with depth"]
    assert 0.7 < share < 1
    # Between ball and surround a pixel would hold a mixed depth.
    between = (radii(points) > 1.1 * RADIUS) & (radii(points) < 0.9 * WALL_RADIUS)
    assert not between.any()


def test_a_scene_without_depth_says_what_to_check(frames: tuple[Frame, ...]) -> None:
    blind = [changed_depth(frame, lambda depth: depth.fill(np.nan)) for frame in frames]
    with pytest.raises(NoPointsError, match=r"0 of them with depth.*metres in EXR"):
        scene_points(blind)
    lacking = [frame.without_layer(Layer.DEPTH) for frame in frames]
    with pytest.raises(DigsError, match="8 of 8 frames have no 'depth_file_path'"):
        scene_points(lacking)
