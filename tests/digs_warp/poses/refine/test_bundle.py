"""Bundle adjustment of poses and distances: the kernels' twin, depth that is wrong in regions, hard input."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from digs_warp.device.parallel import launch_parallel
from digs_warp.poses.agreement import overlapping_pairs, reduced
from digs_warp.poses.refine import bundle_adjustment
from digs_warp.poses.refine.bundle_adjustment import (
    Adjustment,
    adjusted,
    adjusted_where_better,
    motions_between,
    solved,
)
from digs_warp.poses.refine.photometric_alignment import DAMPING, align, in_place
from digs_warp.poses.views import Picture, view_of
from reference.bundle_twin import joint_step
from reference.perturbed_poses import perturbed_poses
from reference.textured_plane import picture, ring_of_poses

TRUTH = ring_of_poses(8)
PICTURES = [picture(pose) for pose in TRUTH]
PAIRS = overlapping_pairs(PICTURES, TRUTH)


def perturbed(degrees: float = 0.5, metres: float = 0.005) -> np.ndarray:
    return np.stack(perturbed_poses(list(TRUTH), degrees, metres, 0))


def wrong_in_regions(pictures: list[Picture], share: float) -> list[Picture]:
    """Return pictures whose depth has waves across the image, each in another direction."""
    wrong = []
    for number, seen in enumerate(pictures):
        rows, columns = np.indices(seen.depth.shape) / 40.0
        wave = np.sin(rows * np.cos(number) + columns * np.sin(number) + number)
        wrong.append(replace(seen, depth=(seen.depth * (1 + share * wave)).astype(np.float32)))
    return wrong


def error_mm(poses: np.ndarray) -> float:
    """Distance of what the cameras look at, 0.7 m ahead, after the best rigid motion of all."""
    moved = in_place(poses, TRUTH, 0.7)
    ahead = moved[:, :3, 3] + 0.7 * moved[:, :3, 2], TRUTH[:, :3, 3] + 0.7 * TRUTH[:, :3, 2]
    return 1000 * float(np.sqrt(np.mean(np.sum((ahead[0] - ahead[1]) ** 2, axis=1))))


def test_a_step_is_that_of_the_whole_system() -> None:
    rolling = replace(PICTURES[1], turn=np.array([0.01, -0.02, 0.01]), shift=np.full(3, 0.004))
    holes = PICTURES[2].depth.copy()
    holes[40:60, 30:90] = np.nan
    pictures = [PICTURES[0], rolling, replace(PICTURES[2], depth=holes)]
    views = [view_of(each, 150) for each in pictures]
    pairs = np.array([[0, 1], [0, 2], [1, 0], [1, 2], [2, 0]], np.int32)
    poses, given = perturbed(0.1, 0.001)[:3], TRUTH[:3]
    trust = np.repeat([1e4, 1e5], 3)
    moved = motions_between(given, poses)
    adjustment = Adjustment(views, pairs)
    system = adjustment.system(poses, 0.3)
    matrix, side, _ = adjustment.equations(system)
    steps = solved(matrix, side, moved, trust)
    expected, nearer = joint_step(
        views, pairs, poses, 0.3, bundle_adjustment.HIDDEN, trust, moved, DAMPING
    )
    np.testing.assert_allclose(steps, expected, rtol=0, atol=2e-3 * np.abs(expected).max())
    adjustment.move_points(system, expected)
    found = adjustment.nearer
    limited = np.clip(nearer, -bundle_adjustment.LARGEST_CHANGE, bundle_adjustment.LARGEST_CHANGE)
    np.testing.assert_allclose(found, limited, rtol=0, atol=1e-4)
    assert np.abs(nearer).max() > bundle_adjustment.LARGEST_CHANGE / 4


def test_depth_that_is_wrong_in_regions_does_not_move_the_cameras() -> None:
    pictures, given = wrong_in_regions(PICTURES, 0.01), perturbed()
    found = align(pictures, given)
    assert found is not None
    assert error_mm(found.poses) > 0.6
    poses = adjusted(pictures, found.pairs, found.poses, given)
    assert error_mm(poses) < 0.3 * error_mm(found.poses)


def test_where_nothing_has_texture_the_measured_depth_counts() -> None:
    rng = np.random.default_rng(0)
    plain = [
        replace(
            p,
            brightness=(0.5 + 0.02 * rng.normal(size=p.brightness.shape)).astype(np.float32),
        )
        for p in PICTURES
    ]
    given = perturbed(0.1, 0.001)
    small = reduced(plain)
    found = adjusted_where_better(plain, small, PAIRS, TRUTH, given)
    np.testing.assert_array_equal(found, TRUTH)
    assert error_mm(adjusted(plain, PAIRS, TRUTH, given)) > 0.5


def test_the_number_of_threads_changes_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    for threads in (1, 3):

        def launched(*args: Any, threads: int = threads) -> None:
            launch_parallel(*args, threads=threads)

        monkeypatch.setattr(bundle_adjustment, "launch_parallel", launched)
        found.append(adjusted(PICTURES, PAIRS, perturbed(0.1, 0.001), TRUTH))
    np.testing.assert_array_equal(*found)
