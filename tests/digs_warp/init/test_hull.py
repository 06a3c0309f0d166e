"""The visual hull of masks: a ball whose silhouettes are known in closed form."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.init.config import InitConfig
from digs_warp.init.depth_points import NoPointsError
from digs_warp.init.recipes import initialize
from reference.ball_capture import INTRINSICS, RADIUS, ball_views, write_capture

HULL = InitConfig(strategy="hull")


@pytest.fixture(scope="module")
def frames(ball_ring: Capture) -> list[Frame]:
    """Photographs and masks, without depth."""
    return [frame.without_layer(Layer.DEPTH) for frame in ball_ring.frames]


def test_the_hull_of_a_ball_is_the_ball_but_for_what_no_view_touches(frames: list[Frame]) -> None:
    start = initialize(frames, HULL)
    assert set(start.sources) == {"hull"} and "no depth" in start.because
    points = start.points.points_world
    radii = np.linalg.norm(points, axis=1)
    pixel = 0.9 / INTRINSICS.fx
    edge = 2 * pixel
    assert (radii > RADIUS - np.sqrt(3) * edge).all()
    # At the poles, which no silhouette touches, the hull of a ring of cameras reaches above the ball.
    beside = np.abs(points[:, 2]) < 0.5 * RADIUS
    assert np.median(radii[beside]) == pytest.approx(RADIUS, abs=2 * pixel)
    # Every direction has a point.
    directions = np.random.default_rng(0).normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert (directions @ (points / radii[:, None]).T).max(axis=1).min() > 0.98


def test_points_have_the_colors_of_the_side_on_which_they_lie(frames: list[Frame]) -> None:
    cloud = initialize(frames, HULL).points
    beside = np.abs(cloud.points_world[:, 2]) < 0.5 * RADIUS
    normals = cloud.points_world / np.linalg.norm(cloud.points_world, axis=1, keepdims=True)
    errors = np.abs(cloud.colors - (normals + 1) / 2)[beside]
    assert np.median(errors) < 0.05 and np.quantile(errors, 0.95) < 0.2


def test_a_mask_that_misses_the_object_in_one_view_of_many_does_not_cut_it(
    tmp_path: Path,
) -> None:
    capture = write_capture(tmp_path, ball_views(24))
    frames = [frame.without_layer(Layer.DEPTH) for frame in capture.frames]
    whole = len(initialize(frames, HULL).points)
    frames[3] = frames[3].with_layer(Layer.MASK, np.zeros((60, 80), np.uint8))
    assert len(initialize(frames, HULL).points) == pytest.approx(whole, rel=0.1)


def test_masks_that_agree_on_no_place_are_named(frames: list[Frame]) -> None:
    """Each view has its object in another corner."""
    corners = []
    for number, frame in enumerate(frames):
        mask = np.zeros((60, 80), np.uint8)
        mask[:8, :8] = 255
        corners.append(
            frame.with_layer(Layer.MASK, np.ascontiguousarray(np.rot90(mask, 2 * (number % 2))))
        )
    with pytest.raises(NoPointsError, match="inside the masks of the 12 views"):
        initialize(corners, HULL)
