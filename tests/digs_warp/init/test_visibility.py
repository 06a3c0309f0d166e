"""What the views say about points, and in which colors they see them: the kernels against plain NumPy."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.layers import Layer
from digs_warp.geometry.camera import Camera
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initialize
from digs_warp.init.seen_colors import colors_in
from digs_warp.init.visibility import (
    DepthViews,
    agreement_of_views,
    count_views,
    hidden,
    not_seen_through,
)
from reference.ball_capture import RADIUS, ball_views, write_capture
from reference.seen_colors_twin import colors_seen
from reference.visibility_twin import agreement_by, said_by

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


def points_around(count: int) -> np.ndarray:
    """Return points on the ball, in front of it, inside it and behind the cameras."""
    rng = np.random.default_rng(2)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return directions * RADIUS * rng.uniform(0.5, 6.0, (count, 1)) ** rng.integers(0, 2, (count, 1))


def test_views_say_what_the_twin_says() -> None:
    points, views = points_around(400), views_with_holes(5)
    found, expected = (
        count_views(points, DepthViews.of(views), VOXEL),
        said_by(points, views, VOXEL),
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


def points_anywhere(count: int) -> np.ndarray:
    """On the ball, in front of it, inside it, behind the cameras, and in no image."""
    rng = np.random.default_rng(2)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return directions * RADIUS * rng.uniform(0.5, 9.0, (count, 1)) ** rng.integers(0, 2, (count, 1))


@pytest.mark.parametrize("without", [(), (Layer.MASK,), (Layer.DEPTH,), (Layer.MASK, Layer.DEPTH)])
def test_colors_are_those_of_the_twin(tmp_path: Path, without: tuple[Layer, ...]) -> None:
    views = ball_views(3)
    for _, images in views:
        images.depth[np.random.default_rng(1).random(images.depth.shape) < 0.1] = np.nan
    points = points_anywhere(600)
    for frame in write_capture(tmp_path, views).frames:
        for layer in without:
            frame = frame.without_layer(layer)
        found, expected = colors_in(points, frame), colors_seen(points, frame)
        np.testing.assert_allclose(found, expected, rtol=1e-14)
        assert 0 < np.isfinite(found[:, 0]).sum() < len(points)
