"""A result that lies elsewhere as a whole: the motion that found poses leave open."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.layers import Layer
from digs_warp.geometry.rigid import matrix_from_rotation_vector, rigid, transform_points
from digs_warp.study.engine.scores import (
    depth_error,
    motion_to_truth,
    seen_in_place,
)
from reference.ball_capture import ball_views, write_capture
from reference.splat_scenes import random_gaussians
from reference.tiny_capture import ball, write_tiny_capture

# Of the world in which the result was made, against the true one.
MOVED = rigid(
    matrix_from_rotation_vector(np.array([0.03, -0.02, 0.05])), np.array([0.01, 0.02, -0.03])
)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> list[Frame]:
    return list(write_capture(tmp_path_factory.mktemp("ball"), ball_views(6)).frames)


@pytest.fixture
def result() -> Gaussians:
    return random_gaussians(3000, seed=0)


def moved(frames: list[Frame], motion: np.ndarray) -> list[Frame]:
    return [
        replace(f, camera=replace(f.camera, world_from_cam=motion @ f.camera.world_from_cam))
        for f in frames
    ]


def test_a_motion_of_everything_is_found(recorded: list[Frame], result: Gaussians) -> None:
    found = motion_to_truth(moved(recorded, MOVED), recorded, result)
    np.testing.assert_allclose(found @ MOVED, np.eye(4), atol=1e-6)
    still = motion_to_truth(recorded, recorded, result)
    np.testing.assert_allclose(still, np.eye(4), atol=1e-6)


def test_errors_of_single_poses_that_cancel_move_nothing(
    recorded: list[Frame], result: Gaussians
) -> None:
    shift = rigid(np.eye(3), np.array([0.02, 0.0, 0.01]))
    there, back = moved(recorded[:3], shift), moved(recorded[3:], np.linalg.inv(shift))
    found = motion_to_truth([*there, *back], recorded, result)
    np.testing.assert_allclose(found, np.eye(4), atol=1e-6)


def test_true_views_see_a_result_where_it_was_made(recorded: list[Frame]) -> None:
    points = np.random.default_rng(0).normal(scale=0.1, size=(50, 3))
    (view,) = seen_in_place(recorded[:1], np.linalg.inv(MOVED))
    expected, _ = recorded[0].camera.project(points)
    found, _ = view.camera.project(transform_points(MOVED, points))
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_depth_is_compared_inside_the_mask_alone(tmp_path: Path) -> None:
    frames = []
    for frame in write_tiny_capture(tmp_path, frames=2).frames:
        mask, depth = frame.load_mask(), frame.load_depth()
        mask[:, :36] = 0
        depth[mask <= 127] = 5.0
        frames.append(frame.with_layer(Layer.MASK, mask).with_layer(Layer.DEPTH, depth))
    found = depth_error(ball(), frames)
    assert found is not None and 0 < found < 0.05  # m
