"""The whole recipe on a ball before a wall, by its masks and as a scene, and every error."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree  # pyright: ignore[reportAttributeAccessIssue]

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.init.config import MASK_THRESHOLD, InitConfig
from digs_warp.init.depth_points import NoPointsError, depth_points
from digs_warp.init.recipes import initialize
from digs_warp.init.start import DepthReport
from reference.ball_capture import INTRINSICS, RADIUS, WALL_RADIUS, ball_views, write_capture

CONFIG = InitConfig(voxel_size=0.02)


def test_points_lie_on_the_ball_with_its_colors_and_cover_its_sides(
    ball_frames: tuple[Frame, ...],
) -> None:
    points = initialize(ball_frames, CONFIG).points
    radii = np.linalg.norm(points.points_world, axis=1)
    # The mean of surface points inside a voxel lies below the surface by its sagitta at most:
    # (diagonal / 2)^2 / (2 radius) = 0.75 mm.
    assert radii.max() < RADIUS * (1 + 1e-5)
    assert radii.min() > RADIUS - 0.00075
    # 8 bits round the color by 1/255; inside a voxel the normals differ by less than 5 degrees.
    np.testing.assert_allclose(points.colors, points.points_world / RADIUS / 2 + 0.5, atol=0.006)
    azimuth = np.degrees(np.arctan2(points.points_world[:, 1], points.points_world[:, 0]))
    assert np.histogram(azimuth, bins=12, range=(-180, 180))[0].min() > 20


def test_the_same_frames_give_the_same_bits_with_one_thread_and_four(
    ball_frames: tuple[Frame, ...], monkeypatch
) -> None:
    found = []
    for threads in ("1", "4"):
        monkeypatch.setenv("DIGS_WARP_THREADS", threads)
        found.append(initialize(ball_frames, CONFIG).points)
    np.testing.assert_array_equal(found[0].points_world, found[1].points_world)
    np.testing.assert_array_equal(found[0].colors, found[1].colors)


def test_a_view_without_foreground_is_skipped_with_a_warning(tmp_path: Path, caplog) -> None:
    camera, images = ball_views()[1]
    empty = replace(images, mask=np.full_like(images.mask, MASK_THRESHOLD))
    capture = write_capture(tmp_path, [ball_views()[0], (camera, empty), *ball_views()[2:]])
    with caplog.at_level(logging.WARNING):
        points = initialize(capture.frames, CONFIG).points
    assert [record.getMessage() for record in caplog.records] == [
        "frame '0001': no mask pixel above 20, skipped"
    ]
    assert np.linalg.norm(points.points_world, axis=1).max() < RADIUS * (1 + 1e-5)


def test_dotted_depth_goes_without_the_edge_filter(tmp_path: Path, caplog) -> None:
    camera, images = ball_views()[0]
    sparse = np.full_like(images.depth, np.nan)
    sparse[::3, ::3] = images.depth[::3, ::3]
    capture = write_capture(tmp_path, [(camera, replace(images, depth=sparse))])
    with caplog.at_level(logging.WARNING):
        found = initialize(capture.frames, CONFIG).points
    assert (
        len(found)
        == len(initialize(capture.frames, replace(CONFIG, edge_filter=False)).points)
        > 20
    )
    assert "consists of dots or thin lines: it is left out" in caplog.text
    assert "are with depth (" in caplog.text  # a ninth of the pixels


def test_depth_of_next_to_nothing_is_an_error_in_images_of_some_size() -> None:
    for size in (1, 10):
        k = Intrinsics.from_fov(40 * size, 30 * size, 60.0)
        depth = np.full((k.height, k.width), np.nan, np.float32)
        depth[:: 5 * size, :: 5 * size] = 2.0
        layers: dict[Layer, np.ndarray] = {
            Layer.IMAGE: np.zeros((*depth.shape, 3), np.uint8),
            Layer.DEPTH: depth,
            Layer.MASK: np.full(depth.shape, 255, np.uint8),
        }
        frame = Frame("0000", Camera(k, np.eye(4)), 0.0, layers)
        if size == 1:
            assert len(initialize([frame], CONFIG).points) > 40
            continue
        with pytest.raises(DigsError, match=r"points are left of 120,000 pixels.*--strategy mvs"):
            initialize([frame], CONFIG)


def test_a_frame_without_depth_only_gives_no_points(tmp_path: Path, caplog) -> None:
    first, second, third = write_capture(tmp_path, ball_views(8)[:3]).frames
    found = initialize([first, second.without_layer(Layer.DEPTH), third], CONFIG).points
    assert "1 frame of 3 without depth, first '0001'" in caplog.text
    expected = initialize([first, third], CONFIG).points
    np.testing.assert_array_equal(found.points_world, expected.points_world)
    bare = [frame.without_layer(Layer.DEPTH) for frame in (first, second)]
    with pytest.raises(DigsError, match=r"2 of 2 frames have no 'depth_file_path' .*EXR"):
        initialize(bare, CONFIG)


def test_nothing_to_start_from_tells_the_counts(tmp_path: Path) -> None:
    camera, images = ball_views()[0]
    blind = replace(images, depth=np.full_like(images.depth, np.nan))
    counted = f"1 frame: {np.count_nonzero(images.mask)} pixels inside the masks, 0 of them"
    empty = replace(images, mask=images.mask * 0)
    for number, (spoiled, message) in enumerate(
        ((blind, counted), (empty, r"0 pixels inside the masks.*check the masks"))
    ):
        capture = write_capture(tmp_path / str(number), [(camera, spoiled)])
        with pytest.raises(DigsError, match=message):
            initialize(capture.frames, CONFIG)
    with pytest.raises(DigsError, match="no frames"):
        initialize([], CONFIG)
    with pytest.raises(DigsError, match="voxel-size"):
        InitConfig(voxel_size=float("nan"))


# The ball's rim is a depth jump in every view: a filter takes more of such small images than of photographs.
SCENE = InitConfig(edge_filter=False)


def scene_points(
    frames: Sequence[Frame], config: InitConfig = SCENE
) -> tuple[PointCloud, DepthReport]:
    return depth_points(frames, config, subject="scene")


# Rows and columns in which a view measures nothing.
HOLE = (slice(0, 9), slice(0, 30))


@pytest.fixture(scope="module")
def found(ball_frames: tuple[Frame, ...]) -> tuple[PointCloud, DepthReport]:
    return scene_points(ball_frames)


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


def test_what_no_view_measured_gets_the_depth_of_its_neighbors(
    ball_frames: tuple[Frame, ...],
) -> None:
    # The upper left corner of every view shows surround that no other view shows.
    holed = [with_hole(frame) for frame in ball_frames]
    points, report = scene_points(holed)
    guessed = guesses_of(points)
    assert len(guessed) == report.voxels["guessed"] > 30
    px, depth = ball_frames[0].camera.project(guessed)
    inside = (depth > 0) & np.all((px > 0) & (px < [30, 9]), axis=1)
    assert inside.sum() > 10
    # The surround's depth changes by less than 10 % towards the corner.
    assert np.linalg.norm(guessed, axis=1)[inside] == pytest.approx(WALL_RADIUS, rel=0.15)


def test_a_guess_that_other_views_see_through_is_dropped(ball_frames: tuple[Frame, ...]) -> None:
    """A view that measured only the ball puts the whole surround at the ball's depth."""

    def only_ball(depth: np.ndarray) -> None:
        depth[depth > 1.5] = np.nan

    points, _ = scene_points([changed_depth(ball_frames[0], only_ball), *ball_frames[1:]])
    in_the_air = (radii(points) > 1.2 * RADIUS) & (radii(points) < 0.8 * WALL_RADIUS)
    assert np.mean(in_the_air) < 0.01  # more than .02 without a look at the other views
    # Views agree with exact depth; where nobody looks, points are as sure as before.
    assert points.agreement is not None and np.median(points.agreement) > 0.8


def test_the_edge_filter_keeps_a_receding_floor_and_drops_the_balls_rim(
    ball_frames: tuple[Frame, ...],
) -> None:
    points, report = scene_points(ball_frames, replace(SCENE, edge_filter=True))
    share = report.pixels["away from edges"] / report.pixels["with depth"]
    assert 0.7 < share < 1
    # Between ball and surround a pixel would hold a mixed depth.
    between = (radii(points) > 1.1 * RADIUS) & (radii(points) < 0.9 * WALL_RADIUS)
    assert not between.any()


def test_a_scene_without_depth_says_what_to_check(ball_frames: tuple[Frame, ...]) -> None:
    blind = [changed_depth(frame, lambda depth: depth.fill(np.nan)) for frame in ball_frames]
    with pytest.raises(NoPointsError, match=r"0 of them with depth.*metres in EXR"):
        scene_points(blind)
    lacking = [frame.without_layer(Layer.DEPTH) for frame in ball_frames]
    with pytest.raises(DigsError, match="8 of 8 frames have no 'depth_file_path'"):
        scene_points(lacking)
