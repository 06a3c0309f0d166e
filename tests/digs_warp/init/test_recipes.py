"""The whole recipe on a ball in front of a wall, captured by cameras around it, and every error."""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.init.config import MASK_THRESHOLD, InitConfig
from digs_warp.init.recipes import initialize
from reference.ball_capture import RADIUS, View, ball_views, write_capture

CONFIG = InitConfig(voxel_size=0.02)


@pytest.fixture(scope="module")
def views() -> list[View]:
    return ball_views()


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory, views: list[View]) -> tuple[Frame, ...]:
    return write_capture(tmp_path_factory.mktemp("ball"), views).frames


def without(frame: Frame, key: Layer) -> Frame:
    return replace(frame, layers={k: path for k, path in frame.layers.items() if k != key})


def test_points_lie_on_the_ball_with_its_colors_and_cover_its_sides(
    frames: tuple[Frame, ...],
) -> None:
    points = initialize(frames, CONFIG).points
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
    frames: tuple[Frame, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = []
    for threads in ("1", "4"):
        monkeypatch.setenv("DIGS_WARP_THREADS", threads)
        found.append(initialize(frames, CONFIG).points)
    np.testing.assert_array_equal(found[0].points_world, found[1].points_world)
    np.testing.assert_array_equal(found[0].colors, found[1].colors)


def test_a_view_without_foreground_is_skipped_with_a_warning(
    tmp_path: Path,
    views: list[View],
    caplog: pytest.LogCaptureFixture,
) -> None:
    camera, images = views[1]
    empty = replace(images, mask=np.full_like(images.mask, MASK_THRESHOLD))
    capture = write_capture(tmp_path, [views[0], (camera, empty), *views[2:]])
    with caplog.at_level(logging.WARNING):
        points = initialize(capture.frames, CONFIG).points
    assert [record.getMessage() for record in caplog.records] == [
        "frame '0001': no mask pixel above 20, skipped"
    ]
    assert np.linalg.norm(points.points_world, axis=1).max() < RADIUS * (1 + 1e-5)


def test_dotted_depth_goes_without_the_edge_filter(
    tmp_path: Path, views: list[View], caplog: pytest.LogCaptureFixture
) -> None:
    camera, images = views[0]
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


def test_a_frame_without_depth_only_gives_no_points(
    tmp_path: Path, views: list[View], caplog: pytest.LogCaptureFixture
) -> None:
    first, second, third = write_capture(tmp_path, views[:3]).frames
    found = initialize([first, without(second, Layer.DEPTH), third], CONFIG).points
    assert "1 frame of 3 without depth, first '0001'" in caplog.text
    expected = initialize([first, third], CONFIG).points
    np.testing.assert_array_equal(found.points_world, expected.points_world)
    bare = [without(frame, Layer.DEPTH) for frame in (first, second)]
    with pytest.raises(DigsError, match=r"2 of 2 frames have no 'depth_file_path' .*EXR"):
        initialize(bare, CONFIG)


def test_nothing_to_start_from_tells_the_counts(tmp_path: Path, views: list[View]) -> None:
    camera, images = views[0]
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
