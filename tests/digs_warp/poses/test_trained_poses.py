"""Cameras that move in the training: the motion that two images tell, the place of all, and what is kept."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import (
    invert_rigid,
    matrix_from_quat_xyzw,
    matrix_from_rotation_vector,
    rigid,
    transform_points,
)
from digs_warp.poses.in_training import PoseTraining, TrainedPoses, motion_between, moved
from digs_warp.splat.device import DeviceGaussians, move_gaussians
from digs_warp.train.checkpoint import load_checkpoint, save_checkpoint
from digs_warp.train.config import Stop, TrainConfig
from digs_warp.train.evaluate import load_test_views, moved_views
from digs_warp.train.trainer import Resolved, Trainer
from digs_warp.train.view_store import open_views
from reference.tiny_capture import ball, write_tiny_capture

SIZE = Intrinsics(200, 160, 220.0, 215.0, 96.0, 83.0)


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return write_tiny_capture(tmp_path_factory.mktemp("tiny") / "capture", frames=6)


# A wall that leads away to the right: z = 1 + 0.8 x.
SLANT = np.array([-0.8, 0.0, 1.0])


def wall(world_from_cam: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what a camera sees of a pattern on the wall, and its depth, from the rays of its pixels."""
    rows, columns = np.indices((SIZE.height, SIZE.width)) + 0.5
    rays = np.stack(
        [(columns - SIZE.cx) / SIZE.fx, (rows - SIZE.cy) / SIZE.fy, np.ones_like(rows)], axis=-1
    )
    directions, center = rays @ world_from_cam[:3, :3].T, world_from_cam[:3, 3]
    depth = (1 - SLANT @ center) / (directions @ SLANT)
    x, y, _ = np.moveaxis(center + depth[..., None] * directions, 2, 0)
    waves = [np.sin(40 * x + 17 * y), np.cos(45 * y), np.sin(29 * (x - y))]
    return 0.5 + 0.3 * np.stack(waves, axis=-1), depth


@pytest.mark.parametrize(("axis", "deep"), [*((n, True) for n in range(6)), (0, False), (2, False)])
def test_images_and_depth_tell_how_a_camera_has_to_move(axis: int, deep: bool) -> None:
    missing = moved(np.eye(4), 0.01 * np.eye(6)[axis])  # 2 px
    box = (24, 16, 184, 144)
    part = (slice(16, 144), slice(24, 184))
    photograph, found = wall(missing)[0][part], np.eye(4)
    for pool in (4, 2, 1, 1, 1, 1, 1):
        drawn, depth = (each[part] for each in wall(found))
        step = motion_between(drawn, photograph, SIZE, box, pool, depth if deep else None)
        assert deep or not step[3:].any()  # without depth, it only turns
        found = moved(found, step)
    np.testing.assert_allclose(found, missing, atol=3e-4)
    drawn, depth = (each[part] for each in wall(np.eye(4)))
    quick, slow = (
        motion_between(drawn, photograph, SIZE, box, 1, depth, damping) for damping in (0.0, 1e4)
    )
    assert np.linalg.norm(slow[3:]) < 1e-3 * max(np.linalg.norm(quick[3:]), 1e-2)


def test_plain_images_move_nothing() -> None:
    plain = np.full((40, 50, 3), 0.4)
    for other in (plain, plain + 0.2, plain[:3, :3], plain[:0, :0]):
        first, depth = plain[: other.shape[0], : other.shape[1]], np.ones(other.shape[:2])
        for known in (None, depth):
            motion = motion_between(first, other, SIZE, (0, 0, 1, 1), 1, known)
            np.testing.assert_array_equal(motion, 0)


def test_all_cameras_together_stay_where_they_were() -> None:
    points = np.random.default_rng(0).normal(size=(50, 3))
    given = [rigid(matrix_from_rotation_vector(w), 5 * w) for w in np.eye(3)]
    poses = TrainedPoses([Camera(SIZE, pose) for pose in given], points, 100)
    motion = rigid(matrix_from_rotation_vector(np.array([0.01, -0.02, 0.005])), np.full(3, 0.1))
    poses.poses = motion @ np.stack(given)
    back = poses.moved_back()
    np.testing.assert_allclose(back, invert_rigid(motion), atol=1e-12)
    np.testing.assert_allclose(poses.poses, given, atol=1e-12)
    poses.poses[:, :3, 3] *= 1.02  # all from farther away
    poses.moved_back()
    away = [
        np.linalg.norm(each[:, :3, 3] - np.median(points, axis=0), axis=1).mean()
        for each in (poses.poses, np.stack(given))
    ]
    assert away[0] == pytest.approx(away[1], rel=1e-12)


def test_gaussians_move_with_the_cameras() -> None:
    truth = ball(40)
    gaussians = DeviceGaussians.from_numpy(truth)
    motion = rigid(matrix_from_rotation_vector(np.array([0.3, -0.2, 0.5])), np.array([1.0, 2, 3]))
    move_gaussians(gaussians, motion)
    moved = gaussians.to_numpy()
    np.testing.assert_allclose(moved.means, transform_points(motion, truth.means), atol=1e-6)
    axes, before = matrix_from_quat_xyzw(moved.quats), matrix_from_quat_xyzw(truth.quats)
    np.testing.assert_allclose(axes, motion[:3, :3] @ before, atol=1e-6)


def misplaced(capture: Capture) -> Capture:
    """Return the capture with cameras turned by about a degree, 1.5 px."""
    rng = np.random.default_rng(3)
    turns = np.pad(rng.normal(size=(6, 3)) * 0.015, ((0, 0), (0, 3)))
    frames = [
        replace(f, camera=replace(f.camera, world_from_cam=moved(f.camera.world_from_cam, motion)))
        for f, motion in zip(capture.frames, turns, strict=True)
    ]
    return replace(capture, frames=tuple(frames))


def trainer_of(
    capture: Capture, config: TrainConfig, first_step: int = 0, poses: PoseTraining = "moved"
) -> Trainer:
    views = open_views(capture.frames, config, first_step)
    return Trainer(ball(300), views, config, Resolved(train_poses=poses))


def test_cameras_that_only_turn_keep_their_centers(capture: Capture) -> None:
    wrong = misplaced(capture)
    trainer = trainer_of(wrong, TrainConfig(stop=Stop(iterations=60)), poses="turned")
    for _ in range(60):
        trainer.step()
    assert trainer.poses is not None
    before = np.stack([frame.camera.world_from_cam for frame in wrong.frames])
    assert spread(trainer.poses.poses, capture) < 0.4 * spread(before, capture)
    # All together are moved back and scaled, so only the shape of the whole tells.
    apart = [
        np.linalg.norm(p[:, None, :3, 3] - p[:, :3, 3], axis=2)
        for p in (before, trainer.poses.poses)
    ]
    shapes = [each / each.mean() for each in apart]
    np.testing.assert_allclose(*shapes, atol=1e-9)


def test_training_moves_cameras_and_continues_bit_for_bit(capture: Capture, tmp_path: Path) -> None:
    config = TrainConfig(stop=Stop(iterations=60))
    wrong = misplaced(capture)
    whole = trainer_of(wrong, config)
    for step in range(60):
        if step == 25:
            assert save_checkpoint(tmp_path / "checkpoint.npz", whole)
        whole.step()
    resumed = trainer_of(wrong, config, 25)
    load_checkpoint(tmp_path / "checkpoint.npz", resumed)
    for _ in range(35):
        resumed.step()
    assert whole.poses is not None and resumed.poses is not None
    np.testing.assert_array_equal(whole.poses.poses, resumed.poses.poses)
    np.testing.assert_array_equal(whole.gaussians.means.numpy(), resumed.gaussians.means.numpy())
    before = [frame.camera.world_from_cam for frame in wrong.frames]
    assert spread(whole.poses.poses, capture) < 0.4 * spread(np.stack(before), capture)


def test_held_out_cameras_move_until_the_gaussians_fit(capture: Capture) -> None:
    truth = DeviceGaussians.from_numpy(ball(3000))
    wrong = misplaced(capture)
    views = moved_views(truth, load_test_views(wrong.frames))
    before = np.stack([frame.camera.world_from_cam for frame in wrong.frames])
    found = np.stack([view.camera.world_from_cam for view in views])
    assert spread(found, capture) < 0.4 * spread(before, capture)


def spread(poses: np.ndarray, capture: Capture) -> float:
    """Return by how much the image of the ball's middle is off, without what all have in common [rad]."""
    true = np.stack([frame.camera.world_from_cam for frame in capture.frames])
    middles = [
        transform_points(found @ invert_rigid(pose), np.zeros((1, 3)))[0]
        for found, pose in zip(poses, true, strict=True)
    ]
    apart = np.stack(middles) - np.mean(middles, axis=0)
    # Along the view, a camera makes up for a ball that is drawn a little too large: the image stays.
    forward = true[:, :3, 2]
    apart -= (apart * forward).sum(axis=1, keepdims=True) * forward
    return float(np.sqrt((apart**2).sum(axis=1).mean()))
