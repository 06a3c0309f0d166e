"""Spoilt masks are worse with strength, and the same for the same seed; pose errors have the stated size."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from digs_warp.data.images import read_image
from digs_warp.geometry.rigid import is_rigid, look_at
from digs_warp.masks.config import SegmentConfig
from digs_warp.masks.masks import intersection_over_union, segment
from digs_warp.study.engine.input_errors import (
    degrade_mask,
    perturbed_poses,
    smooth_noise,
    write_degraded_masks,
)
from reference.tiny_capture import write_tiny_capture

V, U = np.mgrid[:150, :200]
DISK = np.clip(255 * (40.5 - np.hypot(U - 95, V - 70)), 0, 255).astype(np.uint8)


def mean_overlap(strength: float) -> float:
    return float(
        np.mean(
            [intersection_over_union(degrade_mask(DISK, strength, (s,)), DISK) for s in range(8)]
        )
    )


def test_strength_zero_changes_nothing() -> None:
    np.testing.assert_array_equal(degrade_mask(DISK, 0.0, (1,)), DISK)


def test_more_strength_is_worse() -> None:
    overlaps = [mean_overlap(strength) for strength in (0.25, 0.5, 1.0, 2.0, 4.0)]
    assert overlaps == sorted(overlaps, reverse=True)
    assert 0.85 < overlaps[2] < 0.96
    assert overlaps[0] > 0.97


def test_pieces_are_missing_and_others_leak() -> None:
    spoilt = degrade_mask(DISK, 2.0, (3,))
    assert np.count_nonzero((spoilt < 10) & (DISK > 245)) > 50
    assert np.count_nonzero((spoilt > 245) & (DISK < 10)) > 50


def test_errors_mean_the_same_at_every_resolution() -> None:
    v, u = np.mgrid[:300, :400]
    large = np.clip(255 * (81 - np.hypot(u - 190, v - 140)), 0, 255).astype(np.uint8)
    overlap = [intersection_over_union(degrade_mask(large, 1.0, (s,)), large) for s in range(8)]
    assert np.mean(overlap) == pytest.approx(mean_overlap(1.0), abs=0.03)


def test_the_seed_decides() -> None:
    np.testing.assert_array_equal(degrade_mask(DISK, 1.0, (0, 5)), degrade_mask(DISK, 1.0, (0, 5)))
    assert (degrade_mask(DISK, 1.0, (0, 5)) != degrade_mask(DISK, 1.0, (0, 6))).any()


@pytest.mark.parametrize("value", [0, 255])
def test_empty_and_full_masks_are_possible(value: int) -> None:
    spoilt = degrade_mask(np.full((40, 50), value, np.uint8), 1.0, (0,))
    assert spoilt.shape == (40, 50)
    assert spoilt.any() == bool(value)


def test_a_mask_of_one_pixel_is_possible() -> None:
    mask = np.zeros((40, 50), np.uint8)
    mask[20, 30] = 255
    assert degrade_mask(mask, 1.0, (0,)).shape == mask.shape


def test_noise_is_smooth_and_of_about_unit_variance() -> None:
    noise = smooth_noise((400, 400), 20.0, np.random.default_rng(0))
    assert 0.6 < noise.std() < 1.1
    assert np.abs(np.diff(noise, axis=0)).max() < 0.5


def test_every_frame_of_a_capture_gets_other_errors(tmp_path: Path) -> None:
    frames = write_tiny_capture(tmp_path / "capture", frames=4).frames
    write_degraded_masks(frames, 2.0, 0, tmp_path / "masks")
    config = SegmentConfig(masks="folder", mask_folder=tmp_path / "masks")
    overlaps = [
        intersection_over_union(read_image(path)[..., 0], frame.load_mask())
        for path, frame in zip(segment(frames, config, tmp_path / "made"), frames, strict=True)
    ]
    assert all(0.3 < overlap < 0.98 for overlap in overlaps)
    assert len(set(overlaps)) == len(overlaps)


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


def test_no_error_leaves_the_poses_alone_and_any_number_will_do() -> None:
    assert [len(perturbed_poses(POSES[:count], 1.0, 1.0, seed=0)) for count in (0, 1)] == [0, 1]
    for wrong, pose in zip(perturbed_poses(POSES[:5], 0.0, 0.0, seed=3), POSES, strict=False):
        np.testing.assert_allclose(wrong, pose, atol=1e-15)


def test_the_seed_gives_directions_the_size_only_scales() -> None:
    small = perturbed_poses(POSES[:5], 0.0, 0.001, seed=4)
    large = perturbed_poses(POSES[:5], 0.0, 0.003, seed=4)
    for pose, a, b in zip(POSES, small, large, strict=False):
        np.testing.assert_allclose(3 * (a - pose), b - pose, atol=1e-12)
    assert not np.allclose(perturbed_poses(POSES[:5], 0.0, 0.001, seed=5)[0], small[0])
