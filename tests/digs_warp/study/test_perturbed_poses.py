"""Pose errors have the stated size."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from digs_warp.geometry.rigid import is_rigid, look_at
from digs_warp.study.engine.perturb import perturbed_poses

POSES = [look_at(np.array([0.9, 0.1, 0.2]), np.zeros(3), np.array([0.0, 0.0, 1.0]))] * 3000


def test_rotation_and_position_get_the_stated_deviation() -> None:
    wrong = perturbed_poses(POSES, rotation_error_deg=0.5, translation_error=0.004, seed=1)
    assert all(is_rigid(pose) for pose in wrong)
    shifts = np.array([w[:3, 3] - p[:3, 3] for w, p in zip(wrong, POSES, strict=True)])
    turns = [
        Rotation.from_matrix(p[:3, :3].T @ w[:3, :3]).as_rotvec(degrees=True)
        for w, p in zip(wrong, POSES, strict=True)
    ]
    np.testing.assert_allclose(shifts.std(axis=0), 0.004, rtol=0.06)
    np.testing.assert_allclose(np.std(turns, axis=0), 0.5, rtol=0.06)
    assert abs(shifts.mean()) < 0.0003


def test_no_error_leaves_the_poses_alone() -> None:
    for wrong, pose in zip(perturbed_poses(POSES[:5], 0.0, 0.0, seed=3), POSES, strict=False):
        np.testing.assert_allclose(wrong, pose, atol=1e-15)


def test_the_seed_gives_directions_the_size_only_scales() -> None:
    small = perturbed_poses(POSES[:5], 0.0, 0.001, seed=4)
    large = perturbed_poses(POSES[:5], 0.0, 0.003, seed=4)
    for pose, a, b in zip(POSES, small, large, strict=False):
        np.testing.assert_allclose(3 * (a - pose), b - pose, atol=1e-12)
    assert not np.allclose(perturbed_poses(POSES[:5], 0.0, 0.001, seed=5)[0], small[0])


@pytest.mark.parametrize("count", [0, 1])
def test_any_number_of_poses(count: int) -> None:
    assert len(perturbed_poses(POSES[:count], 1.0, 1.0, seed=0)) == count
