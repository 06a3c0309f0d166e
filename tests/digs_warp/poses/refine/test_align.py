"""Alignment of frames with color and depth: the kernel's twin, poses brought back, hard input."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import invert_rigid, matrix_from_rotation_vector, rigid
from digs_warp.pipeline.optimize import pose_training
from digs_warp.poses.agreement import got_worse, overlapping_pairs
from digs_warp.poses.refine.bundle_adjustment import adjusted, in_likely_scale
from digs_warp.poses.refine.photometric_alignment import (
    Alignment,
    PairComparison,
    Scales,
    align,
    in_place,
)
from digs_warp.poses.refine.refine import refine
from digs_warp.poses.views import Picture, view_of
from reference.pair_twin import pair_equations
from reference.perturbed_poses import perturbed_poses
from reference.textured_plane import INTRINSICS, picture, ring_of_poses

TRUTH = ring_of_poses(8)
PICTURES = [picture(pose) for pose in TRUTH]


def perturbed(degrees: float = 0.5, metres: float = 0.005) -> np.ndarray:
    return np.stack(perturbed_poses(list(TRUTH), degrees, metres, 0))


def error_mm(poses: np.ndarray) -> float:
    """Distance of what the cameras look at, 0.7 m ahead, after the best rigid motion of all."""
    moved = in_place(poses, TRUTH, 0.7)
    ahead = moved[:, :3, 3] + 0.7 * moved[:, :3, 2], TRUTH[:, :3, 3] + 0.7 * TRUTH[:, :3, 2]
    apart = np.linalg.norm(ahead[0] - ahead[1], axis=1)
    return 1000 * float(np.sqrt(np.mean(apart**2)))


def frames_at(poses: np.ndarray, depth: bool = True) -> list[Frame]:
    frames = []
    for number, (pose, seen) in enumerate(zip(poses, PICTURES, strict=True)):
        image = np.repeat((255 * seen.brightness).clip(0, 255).astype(np.uint8)[..., None], 3, 2)
        layers = {Layer.IMAGE: image} | ({Layer.DEPTH: seen.depth} if depth else {})
        frames.append(Frame(f"{number:04d}", Camera(INTRINSICS, pose), 0.1 * number, layers))
    return frames


def test_the_equations_of_a_pair_are_those_of_the_twin() -> None:
    poses = perturbed(0.2, 0.002)
    rolling = replace(PICTURES[1], turn=np.array([0.01, -0.02, 0.01]), shift=np.full(3, 0.004))
    holes = rolling.depth.copy()
    holes[40:60, 30:90] = np.nan
    views = [view_of(PICTURES[0]), view_of(replace(rolling, depth=holes))]
    pairs, scales = np.array([[0, 1], [1, 0]], np.int32), Scales(0.3, 0.02)
    sums = PairComparison(views, pairs).sums(poses[:2], scales, 0.1)
    for number, (i, j) in enumerate(pairs):
        relative = invert_rigid(poses[j]) @ poses[i]
        matrix, side = pair_equations(views[i], views[j], relative, scales, 0.1)
        np.testing.assert_allclose(
            sums.matrices[number], matrix, rtol=2e-3, atol=1e-4 * matrix.max()
        )
        np.testing.assert_allclose(sums.sides[number], side, rtol=0, atol=2e-3 * np.abs(side).max())


def test_the_number_of_threads_changes_no_bit() -> None:
    views = [view_of(each) for each in PICTURES]
    comparison = PairComparison(views, overlapping_pairs(PICTURES, TRUTH))
    one, three = (comparison.sums(perturbed(), Scales(0.3, 0.02), 0.1, n) for n in (1, 3))
    assert (one.matrices == three.matrices).all()
    assert (one.sides == three.sides).all()


def test_perturbed_poses_come_back() -> None:
    found = align(PICTURES, perturbed())
    assert found is not None
    assert error_mm(perturbed()) > 5.0
    assert error_mm(found.poses) < 0.5
    assert found.error_after < 0.5 * found.error_before
    # Together they are not moved.
    np.testing.assert_allclose(in_place(found.poses, perturbed(), 0.7), found.poses, atol=2e-3)


def test_images_of_different_sizes_are_aligned() -> None:
    """Two cameras, or photographs of which some were reduced: they cannot be halved equally often."""
    mixed = [
        each.at_most(each.intrinsics.width // (1 + 3 * (i % 2))) for i, each in enumerate(PICTURES)
    ]
    found = align(mixed, perturbed())
    assert found is not None
    assert error_mm(found.poses) < 0.2 * error_mm(perturbed())
    adjusted_poses = adjusted(mixed, found.pairs, found.poses, perturbed())
    assert error_mm(adjusted_poses) < 0.2 * error_mm(perturbed())


def test_auto_leaves_good_poses_and_refines_bad_ones() -> None:
    frames, good = refine(frames_at(TRUTH), 0.0, needed=False)
    assert not good.refined and good.because
    assert all((f.camera.world_from_cam == t).all() for f, t in zip(frames, TRUTH, strict=True))
    frames, bad = refine(frames_at(perturbed()), 0.0, needed=False)
    assert bad.refined and bad.moved_mm > 1.0
    # Half of it is the scale, of which the given centers tell as much as the depth.
    assert error_mm(np.stack([frame.camera.world_from_cam for frame in frames])) < 1.2


def test_only_centers_of_the_bundle_adjustment_are_held_in_the_training() -> None:
    frames = frames_at(perturbed())
    assert refine(frames, 0.0, needed=True)[1].adjusted
    # Where nothing has texture, the aligned poses stay.
    rng = np.random.default_rng(0)
    gray = [(128 + 5 * rng.normal(size=(120, 160, 3))).astype(np.uint8) for _ in frames]
    plain = [f.with_layer(Layer.IMAGE, each) for f, each in zip(frames, gray, strict=True)]
    _, refinement = refine(plain, 0.0, needed=True)
    assert refinement.refined and not refinement.adjusted
    assert pose_training(replace(refinement, in_training=True)) == "moved"
    held = replace(refinement, in_training=True, adjusted=True)
    assert pose_training(held) == "turned"


def test_a_frame_that_would_agree_less_keeps_its_pose(monkeypatch: pytest.MonkeyPatch) -> None:
    given, slid = perturbed(), 3
    slide = rigid(matrix_from_rotation_vector(np.array([0.0, 0.08, 0.0])), np.array([0.03, 0, 0]))

    def sliding(*args: Any) -> Alignment:
        found = align(*args)
        assert found is not None
        found.poses[slid] = found.poses[slid] @ slide
        return found

    monkeypatch.setattr("digs_warp.poses.refine.refine.align", sliding)
    frames, refinement = refine(frames_at(given), 0.0, needed=True)
    kept = [n for n in range(8) if (frames[n].camera.world_from_cam == given[n]).all()]
    assert kept == [slid]
    assert refinement.because.endswith("; 1 frame would agree less and kept the pose")


def test_a_frame_does_not_stay_behind_where_all_move_together() -> None:
    """Its old pose fits the old ones of the others, and not the new ones."""
    together = rigid(matrix_from_rotation_vector(np.array([0.0, 0.1, 0.0])), np.array([0.05, 0, 0]))
    after = TRUTH.copy()
    after[3, :3, 3] += 0.003  # the alignment was a little worse there
    pairs = overlapping_pairs(PICTURES, TRUTH)
    assert not got_worse(PICTURES, together @ TRUTH, after, pairs).any()


@pytest.mark.parametrize("broken", ["one frame", "black", "constant depth", "no depth", "all NaN"])
def test_hard_input_gives_finite_poses_or_none(broken: str) -> None:
    pictures, poses = list(PICTURES), perturbed()
    if broken == "one frame":
        pictures, poses = pictures[:1], poses[:1]
    elif broken == "black":
        pictures = [replace(p, brightness=np.zeros_like(p.brightness)) for p in pictures]
    elif broken == "constant depth":
        pictures = [replace(p, depth=np.full_like(p.depth, 0.8)) for p in pictures]
    elif broken == "no depth":
        pictures[2] = replace(pictures[2], depth=np.full_like(pictures[2].depth, np.nan))
    else:
        pictures = [replace(p, depth=np.full_like(p.depth, np.nan)) for p in pictures]
    found = align(pictures, poses)
    assert (found is None) == (broken in ("one frame", "all NaN"))
    if found is not None:
        assert np.isfinite(found.poses).all()
        assert np.isfinite(adjusted(pictures, found.pairs, found.poses, poses)).all()


def test_without_depth_on_is_refused_and_auto_says_why() -> None:
    frames = frames_at(TRUTH, depth=False)
    with pytest.raises(DigsError, match="--refine-poses on: no frame has depth"):
        refine(frames, 0.0, needed=True)
    assert refine(frames, 0.0, needed=False)[1].because == "no frame has depth"


def test_frames_that_hold_nothing_together_keep_their_poses() -> None:
    frames = [
        frame.with_layer(Layer.DEPTH, np.full((120, 160), 0.8, np.float32))
        for frame in frames_at(perturbed())
    ]
    with pytest.raises(DigsError, match="do not hold together"):
        refine(frames, 0.0, needed=True)
    kept, refinement = refine(frames, 0.0, needed=False)
    assert not refinement.refined
    assert kept == frames


def wrong_in_scale(radius: float, spread: float) -> float:
    """Return by what share 24 cameras are too far apart in the end, of which the depth says 0.6 %.

    They are on a circle [m], and the given centers are off by ``spread`` [m].
    """
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    circle = radius * np.stack([np.cos(angles), np.sin(angles), np.zeros(24)], axis=1)
    true = np.stack([rigid(np.eye(3), center) for center in circle])
    found, given = true.copy(), true.copy()
    found[:, :3, 3] *= 1.006
    given[:, :3, 3] += np.random.default_rng(0).normal(size=(24, 3)) * spread
    scaled = in_likely_scale(found, given)
    np.testing.assert_array_equal(scaled[:, :3, :3], found[:, :3, :3])
    return float(np.linalg.norm(scaled[:, :3, 3], axis=1).mean()) / radius - 1


def test_given_centers_tell_the_scale_where_they_are_far_apart() -> None:
    assert wrong_in_scale(1.0, 0.0) == pytest.approx(0, abs=1e-9)
    assert abs(wrong_in_scale(1.0, 0.005)) < 0.002
    assert wrong_in_scale(0.03, 0.005) == pytest.approx(0.006, abs=0.002)
    for poses in (TRUTH[:2], np.stack([TRUTH[0]] * 5)):
        np.testing.assert_array_equal(in_likely_scale(poses, poses), poses)


def test_the_gain_of_refined_poses_hardly_depends_on_the_size_of_the_images(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng = np.random.default_rng(0)
    noisy = [
        replace(p, brightness=(p.brightness + rng.normal(0, 0.05, p.brightness.shape)).astype("f4"))
        for p in PICTURES
    ]
    given = perturbed(0.2, 0.002)

    def gain(pictures: Sequence[Picture]) -> float:
        found = align(pictures, given)
        assert found is not None
        return 1 - found.error_after / found.error_before

    small = gain([picture.halved() for picture in noisy])
    apart_at_own_size = abs(gain(noisy) - small)
    monkeypatch.setattr("digs_warp.poses.refine.photometric_alignment.JUDGED", 80)
    assert abs(gain(noisy) - small) < 0.03 < apart_at_own_size


def test_poses_that_are_never_exact_are_refined_where_little_is_gained() -> None:
    slightly_off = perturbed(0.02, 0.0002)
    frames = frames_at(slightly_off)
    kept, left = refine(frames, 0.0, needed=False)
    assert not left.refined and kept == frames
    found, refined = refine(frames, 0.0, needed=False, estimated=True)
    assert refined.refined
    assert error_mm(np.stack([f.camera.world_from_cam for f in found])) < error_mm(slightly_off)
