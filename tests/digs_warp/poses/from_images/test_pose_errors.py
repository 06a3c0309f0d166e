"""Alignment and pose errors against what is known."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.sfm_model import Observations, SfmModel
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at, matrix_from_rotation_vector, rigid
from digs_warp.poses.from_images.similarity import on_one_axis, world_as_recorded
from digs_warp.poses.refine.photometric_alignment import in_place
from studies.pose_errors import pose_errors

INTRINSICS = Intrinsics.from_fov(64, 48, 60.0)


def orbit(count: int = 12) -> list[np.ndarray]:
    angles = np.linspace(0.0, 2 * np.pi, count, endpoint=False)
    eyes = [0.9 * np.array([np.cos(a), np.sin(a), 0.3 + 0.1 * np.sin(3 * a)]) for a in angles]
    return [look_at(eye, np.zeros(3), np.array([0.0, 0.0, 1.0])) for eye in eyes]


def frames_of(poses: list[np.ndarray]) -> list[Frame]:
    return [Frame(f"{i:04d}", Camera(INTRINSICS, p), float(i), {}) for i, p in enumerate(poses)]


def model_of(poses: list[np.ndarray], names: list[str]) -> SfmModel:
    nothing = Observations(np.zeros(0), np.zeros(0), np.zeros((0, 2)))
    cameras = tuple(Camera(INTRINSICS, pose) for pose in poses)
    return SfmModel(
        tuple(names), cameras, PointCloud(np.zeros((0, 3)), np.zeros((0, 3))), nothing, np.zeros(0)
    )


def seen_from_elsewhere(scale: float, motion: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """The pose in a frame that is turned, scaled and moved into the world."""
    elsewhere = np.linalg.inv(motion) @ pose
    elsewhere[:3, 3] /= scale
    return elsewhere


@pytest.mark.parametrize("points", [np.zeros((5, 3)), np.outer(np.arange(5.0), [1.0, 2.0, 3.0])])
def test_points_on_a_line_are_refused(points: np.ndarray) -> None:
    with pytest.raises(DigsError, match="on one line"):
        world_as_recorded(*[[Camera(INTRINSICS, rigid(np.eye(3), p)) for p in points]] * 2)


def test_an_exact_model_has_no_errors_and_tells_the_scale() -> None:
    poses = orbit()
    motion = rigid(matrix_from_rotation_vector(np.array([0.3, -1.2, 0.7])), np.array([1.0, 2, 3]))
    some = [7, 1, 4, 10]  # found by their names
    elsewhere = [seen_from_elsewhere(0.3, motion, poses[i]) for i in some]
    model = model_of(elsewhere, [frames_of(poses)[i].name for i in some])
    errors = pose_errors(model, frames_of(poses))
    assert errors.centers_m.max() < 1e-12
    assert errors.rotations_deg.max() < 1e-6
    assert errors.sfm_per_metre == pytest.approx(1.0 / 0.3)


def test_metric_cameras_are_laid_over_the_recorded_ones() -> None:
    motion = rigid(matrix_from_rotation_vector(np.array([0.3, -1.2, 0.7])), np.array([1.0, 2, 3]))
    recorded = [frame.camera for frame in frames_of(orbit())]
    found = [replace(c, world_from_cam=np.linalg.inv(motion) @ c.world_from_cam) for c in recorded]
    np.testing.assert_allclose(world_as_recorded(found, recorded), motion, atol=1e-12)


def test_poses_before_a_turntable_are_laid_on_one_axis_and_others_are_left() -> None:
    rng = np.random.default_rng(0)
    first = look_at(np.array([0.7, 0.0, 0.5]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
    turns = [matrix_from_rotation_vector(np.array([0, 0, a])) for a in np.linspace(0, 6, 20)]
    true = np.stack([rigid(turn, np.zeros(3)) @ first for turn in turns])
    errors = [
        rigid(
            matrix_from_rotation_vector(0.002 * rng.standard_normal(3)),
            1e-3 * rng.standard_normal(3),
        )
        for _ in true
    ]
    noisy = true @ np.stack(errors)
    found = on_one_axis(noisy)

    def far(poses: np.ndarray) -> float:
        """How far poses are off but for one rigid motion of all [m]."""
        return float(np.linalg.norm((in_place(poses, true, 0.8) - true)[:, :3, 3], axis=1).mean())

    assert far(found) < 0.8 * far(noisy)
    noisy[5, 0, 3] += 0.1
    assert on_one_axis(noisy) is noisy
