"""Alignment of frames with color and depth: the kernel's twin, poses brought back, hard input."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.device.parallel import launch_parallel
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import invert_rigid, matrix_from_rotation_vector, rigid
from digs_warp.pipeline.optimize import pose_training
from digs_warp.poses.agreement import got_worse, overlapping_pairs, reduced
from digs_warp.poses.refine import bundle_adjustment, photometric_alignment
from digs_warp.poses.refine.bundle_adjustment import (
    Adjustment,
    adjusted,
    adjusted_where_better,
    in_likely_scale,
    motions_between,
    solved,
)
from digs_warp.poses.refine.photometric_alignment import (
    DAMPING,
    Alignment,
    PairComparison,
    PairSums,
    Scales,
    align,
    in_place,
    solve,
)
from digs_warp.poses.refine.refine import refine
from digs_warp.poses.views import Picture, view_of
from reference.bundle_twin import joint_step
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


def test_poses_that_are_never_exact_are_refined_where_little_is_gained() -> None:
    slightly_off = perturbed(0.02, 0.0002)
    frames = frames_at(slightly_off)
    kept, left = refine(frames, 0.0, needed=False)
    assert not left.refined and kept == frames
    found, refined = refine(frames, 0.0, needed=False, estimated=True)
    assert refined.refined
    assert error_mm(np.stack([f.camera.world_from_cam for f in found])) < error_mm(slightly_off)


PAIRS = overlapping_pairs(PICTURES, TRUTH)


def wrong_in_regions(pictures: list[Picture], share: float) -> list[Picture]:
    """Return pictures whose depth has waves across the image, each in another direction."""
    wrong = []
    for number, seen in enumerate(pictures):
        rows, columns = np.indices(seen.depth.shape) / 40.0
        wave = np.sin(rows * np.cos(number) + columns * np.sin(number) + number)
        wrong.append(replace(seen, depth=(seen.depth * (1 + share * wave)).astype(np.float32)))
    return wrong


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
        replace(p, brightness=(0.5 + 0.02 * rng.normal(size=p.brightness.shape)).astype(np.float32))
        for p in PICTURES
    ]
    given = perturbed(0.1, 0.001)
    small = reduced(plain)
    found = adjusted_where_better(plain, small, PAIRS, TRUTH, given)
    np.testing.assert_array_equal(found, TRUTH)
    assert error_mm(adjusted(plain, PAIRS, TRUTH, given)) > 0.5


def test_nor_does_it_for_bundles(monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    for threads in (1, 3):

        def launched(*args: Any, threads: int = threads) -> None:
            launch_parallel(*args, threads=threads)

        monkeypatch.setattr(bundle_adjustment, "launch_parallel", launched)
        found.append(adjusted(PICTURES, PAIRS, perturbed(0.1, 0.001), TRUTH))
    np.testing.assert_array_equal(*found)


LAYOUTS = {"walk": 0, "walk with closures": 40}


def neighbors(frames: int, closures: int) -> np.ndarray:
    """Return pairs of each frame with the four before it, and some of frames far apart, (k, 2)."""
    rng = np.random.default_rng(1)
    pairs = {(i, i - back) for i in range(frames) for back in range(1, 5) if i >= back}
    pairs |= {(int(i), int(j)) for i, j in rng.integers(0, frames, (closures, 2)) if i != j}
    return np.array(sorted(pairs | {(j, i) for i, j in pairs}), np.int32)


def sums_of(pairs: np.ndarray) -> PairSums:
    """Return random equations of the pairs, at poses that are a few centimeters apart."""
    rng = np.random.default_rng(2)
    halves = rng.normal(size=(len(pairs), 6, 6))
    motions = np.tile(np.eye(4), (len(pairs), 1, 1))
    motions[:, :3, 3] = rng.normal(size=(len(pairs), 3)) * 0.1
    sides = rng.normal(size=(len(pairs), 6))
    return PairSums(halves @ halves.transpose(0, 2, 1), sides, motions, Scales(1.0, 1.0))


@pytest.mark.parametrize("closures", LAYOUTS.values(), ids=list(LAYOUTS))
def test_many_frames_move_as_with_all_zeros(closures: int, monkeypatch: pytest.MonkeyPatch) -> None:
    pairs = neighbors(100, closures)
    sums = sums_of(pairs)
    assert 6 * 100 >= photometric_alignment.SPARSE_FROM
    found = solve(sums, pairs, 100)
    assert np.array_equal(found, solve(sums, pairs, 100)), "equal input, equal bits"
    monkeypatch.setattr(photometric_alignment, "SPARSE_FROM", 10**9)
    dense = solve(sums, pairs, 100)
    np.testing.assert_allclose(found, dense, rtol=0, atol=1e-11 * np.abs(dense).max())


@pytest.mark.parametrize("frames", [10, 50])
def test_frames_without_neighbors_stay(frames: int) -> None:
    pairs = neighbors(frames, 0)
    steps = solve(sums_of(pairs), pairs, frames + 5)
    assert np.isfinite(steps).all()
    assert not steps[frames:].any()
