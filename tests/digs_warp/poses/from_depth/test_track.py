"""Poses from color and depth alone: their error, loops, and recordings that do not hold together."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import (
    invert_rigid,
    look_at,
    matrix_from_rotation_vector,
    rigid,
    transform_points,
)
from digs_warp.poses import agreement, thresholds
from digs_warp.poses.agreement import correlation, disagreement, overlapping_pairs
from digs_warp.poses.features import Matches, features_of, matched
from digs_warp.poses.from_depth.estimate import holds, track, turn_deg
from digs_warp.poses.from_depth.pair_motion import (
    FrameFeatures,
    FramePair,
    information,
    likely_starts,
)
from digs_warp.poses.outcome import check_depth
from digs_warp.poses.refine.photometric_alignment import in_place
from digs_warp.poses.views import Picture, view_of
from reference.optional import open3d_or_skip
from reference.textured_plane import INTRINSICS, picture, ring_of_poses

TRUTH = ring_of_poses(16)
PICTURES = [picture(pose) for pose in TRUTH]
AWAY = rigid(np.eye(3), np.array([5.3, 2.1, 0.0]))
CORNER = 1 + np.abs(np.linspace(-1, 1, INTRINSICS.width, dtype=np.float32))
ELSEWHERE = [
    replace(seen, brightness=0.5 * seen.brightness, depth=seen.depth * CORNER)
    for seen in (picture(AWAY @ pose) for pose in TRUTH[:3])
]


def frames_in(order: list[int]) -> list[Frame]:
    """Frames without poses, in some order; from 16 on they show a dark corner of two planes."""
    frames = []
    for time, number in enumerate(order):
        seen = [*PICTURES, *ELSEWHERE][number]
        image = np.repeat((255 * seen.brightness).clip(0, 255).astype(np.uint8)[..., None], 3, 2)
        layers = {Layer.IMAGE: image, Layer.DEPTH: seen.depth}
        camera = Camera(INTRINSICS, np.eye(4))
        frames.append(Frame(f"{number:04d}", camera, 0.1 * time, layers))
    return frames


def test_a_ring_of_cameras_comes_back_and_its_loop_closes() -> None:
    open3d_or_skip()
    found = track(frames_in(list(range(16))), 0.0)
    np.testing.assert_allclose(found.poses[0], np.eye(4), atol=1e-9)
    moved = in_place(found.poses, TRUTH, 0.7)
    errors = np.linalg.norm(moved[:, :3, 3] - TRUTH[:, :3, 3], axis=1)
    assert errors.max() < 0.004
    turns = np.linalg.norm((moved - TRUTH)[:, :3, :3], axis=(1, 2)) / np.sqrt(2.0)
    assert np.degrees(turns.max()) < 0.4
    told = found.tracking
    assert told.frames == 16
    assert told.loops > 0 and told.longest_loop == 15
    assert told.residual_mm < 4.0 and told.residual_deg < 0.4
    assert f"{told.loops} loops over up to 15 frames" in str(told)
    # The middle of what is seen is on the plane.
    in_truth = TRUTH[0] @ np.append(found.middle, 1.0)
    assert np.abs(in_truth[:3]).max() < 0.1


def test_a_frame_that_shows_something_else_is_named() -> None:
    open3d_or_skip()
    with pytest.raises(DigsError, match=r"0001 and 0016, 0016 and 0002: .* in order of time"):
        track(frames_in([0, 1, 16, 2, 3]), 0.0)


def test_two_recordings_in_one_break_where_the_second_starts() -> None:
    open3d_or_skip()
    with pytest.raises(DigsError, match=r"1 of 4 steps, between frames 0002 and 0016: .* two rec"):
        track(frames_in([0, 1, 2, 16, 17]), 0.0)


def test_frames_without_depth_are_named() -> None:
    frames = frames_in([0, 1, 2])
    frames[1] = frames[1].without_layer(Layer.DEPTH)
    with pytest.raises(DigsError, match=r"1 of 3 frames have no depth \(0001\).*--poses sfm"):
        check_depth(frames)
    open3d_or_skip()
    frames[1] = frames[1].with_layer(Layer.DEPTH, np.full((120, 160), np.nan, np.float32))
    with pytest.raises(DigsError, match=r"the depth of 1 frame \(0001\) is empty"):
        track(frames, 0.0)


def in_bad_light(seen: Picture, exposure: float, seed: int) -> Picture:
    """The picture with another exposure and noise, and without half of its depth."""
    rng = np.random.default_rng(seed)
    noisy = exposure * seen.brightness + rng.normal(0, 0.08, seen.brightness.shape)
    missing = (rng.uniform(size=(15, 20)) < 0.55).repeat(8, 0).repeat(8, 1)
    depth = np.where(missing, np.nan, seen.depth).astype(np.float32)
    return replace(seen, brightness=noisy.clip(0, 1).astype(np.float32), depth=depth)


@pytest.mark.parametrize("seed", [1, 3, 7])
def test_a_step_holds_where_the_light_changes_and_half_of_the_depth_is_missing(seed: int) -> None:
    open3d_or_skip()
    pair = [in_bad_light(PICTURES[0], 1.0, seed), in_bad_light(PICTURES[1], 0.5, seed + 10)]
    edge = FramePair.of([FrameFeatures.of(each) for each in pair], 0, 1).edge(np.eye(4))
    # Neither of these tells the motion from a wrong one.
    assert (
        edge.disagreement > thresholds.MAX_STEP_DISAGREEMENT
        and edge.matches < thresholds.MIN_STEP_INLIERS
    )
    true = invert_rigid(TRUTH[1]) @ TRUTH[0]
    assert np.degrees(np.abs(edge.target_from_source - true)[:3, :3].max()) < 0.6
    # Their details do, and by far.
    assert edge.correlation > thresholds.MIN_STEP_CORRELATION + 0.1
    assert holds(edge)


def test_the_same_poses_come_from_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    open3d_or_skip()
    frames = frames_in([0, 1, 2, 3, 2, 1])
    found = []
    for threads in ("1", "2", "3"):
        monkeypatch.setenv("DIGS_WARP_THREADS", threads)
        found.append(track(frames, 0.0))
    assert all((each.poses == found[0].poses).all() for each in found)
    assert all(each.tracking == found[0].tracking for each in found)


FIRST_VIEW, SECOND_VIEW = (view_of(picture(pose)) for pose in TRUTH[:2])
TRUE = invert_rigid(TRUTH[1]) @ TRUTH[0]


def one_by_one(points: np.ndarray) -> np.ndarray:
    """Sum over points in the axes of the second frame; slopes by differences."""
    total = np.eye(6)
    for q in points:
        slopes = np.zeros((3, 6))
        for axis in range(3):
            slopes[:, axis] = np.cross(np.eye(3)[axis], q)
            slopes[axis, 3 + axis] = 1.0
        total += slopes.T @ slopes
    return total


def held(chosen: np.ndarray) -> np.ndarray:
    """Of some points of the first frame, those that the second sees."""
    k = SECOND_VIEW.picture.intrinsics
    x, y, z = transform_points(TRUE, FIRST_VIEW.points[chosen].astype(np.float64)).T
    u, v = x / z * k.fx + k.cx, y / z * k.fy + k.cy
    return (u >= 0) & (u < k.width) & (v >= 0) & (v < k.height)


def test_it_is_the_sum_over_the_points_on_the_same_surface() -> None:
    inside = held(np.ones(len(FIRST_VIEW.points), bool))
    assert 0.5 * len(inside) < np.count_nonzero(inside) < len(inside)
    expected = one_by_one(transform_points(TRUE, FIRST_VIEW.points[inside].astype(np.float64)))
    np.testing.assert_allclose(
        information(FIRST_VIEW, SECOND_VIEW, TRUE), expected, rtol=1e-9, atol=1e-6
    )


def test_other_surfaces_and_what_is_far_away_hold_nothing() -> None:
    farther = view_of(replace(SECOND_VIEW.picture, depth=1.3 * SECOND_VIEW.picture.depth))
    np.testing.assert_array_equal(information(FIRST_VIEW, farther, TRUE), np.eye(6))
    # All ten times as large, beside what is usual in the first picture.
    far = replace(FIRST_VIEW, points=10 * FIRST_VIEW.points)
    deep = replace(
        SECOND_VIEW, picture=replace(SECOND_VIEW.picture, depth=10 * SECOND_VIEW.picture.depth)
    )
    moved = rigid(TRUE[:3, :3], 10 * TRUE[:3, 3])
    np.testing.assert_array_equal(information(far, deep, moved), np.eye(6))


CAMERA = Intrinsics(160, 120, 200.0, 200.0, 80.0, 60.0)


def test_features_find_a_motion_far_along_the_ring() -> None:
    first, second = picture(TRUTH[0]), picture(TRUTH[5])
    true = invert_rigid(TRUTH[5]) @ TRUTH[0]
    assert turn_deg(true) > 40
    matches = matched(features_of(first), features_of(second), INTRINSICS)
    found = matches.motion()
    assert found is not None
    assert matches.agreeing(found) > 40
    assert np.abs(found - true).max() < 0.01


def test_two_in_three_wrong_matches_do_not_count_and_noise_is_no_motion() -> None:
    rng = np.random.default_rng(5)
    true = rigid(matrix_from_rotation_vector(np.array([0.1, 0.4, -0.2])), np.array([0.1, 0, 0.2]))
    points = rng.uniform([-1, -1, 2], [1, 1, 3], (60, 3))
    seen = (points @ true[:3, :3].T + true[:3, 3]) @ CAMERA.matrix.T
    px = seen[:, :2] / seen[:, 2:]
    px[20:] = rng.uniform(0, 160, (40, 2))
    found = Matches(points, px, CAMERA).motion()
    assert found is not None
    np.testing.assert_allclose(found, true, atol=1e-5)
    assert Matches(points, px, CAMERA).agreeing(true) == 20
    assert Matches(points[30:], px[30:], CAMERA).motion() is None
    # Behind the camera nothing agrees.
    behind = rigid(np.diag([-1.0, 1.0, -1.0]), np.zeros(3)) @ true
    assert Matches(points, px, CAMERA).agreeing(behind) == 0


@pytest.mark.parametrize("degrees", [-30.0, 18.0])
def test_a_walk_round_what_is_seen_is_among_the_likely_motions(degrees: float) -> None:
    turn = rigid(matrix_from_rotation_vector(np.radians([0, 0, degrees])), np.zeros(3))
    first_pose = look_at(np.array([0.5, 0, 0.6]), np.zeros(3), np.array([0.0, 0, 1]))
    poses = [first_pose, turn @ first_pose]
    first, second = (picture(pose).halved() for pose in poses)
    true = invert_rigid(poses[1]) @ poses[0]
    starts = likely_starts(first, second, np.eye(4), 60)
    assert min(turn_deg(invert_rigid(true) @ start) for start in starts) < 6
    # The best come first.
    apart = [disagreement(first, second, start) for start in starts]
    assert np.mean(apart[:10]) < np.mean(apart[10:30]) < np.mean(apart[30:])


FIRST, SECOND = (picture(pose) for pose in TRUTH[:2])


def of(first: Picture, second: Picture, motion: np.ndarray = TRUE) -> float:
    return correlation(view_of(first), view_of(second), motion)


def test_details_match_under_the_true_motion_in_any_light() -> None:
    darker = replace(SECOND, brightness=0.1 + 0.5 * SECOND.brightness)
    assert of(FIRST, SECOND) > 0.98
    assert of(FIRST, darker) == pytest.approx(of(FIRST, SECOND), abs=0.01)


def test_wrong_motions_have_little() -> None:
    turned = rigid(matrix_from_rotation_vector(np.array([0.0, 0.0, 0.3])), np.zeros(3))
    assert abs(of(FIRST, SECOND, turned @ TRUE)) < 0.3
    behind = rigid(np.diag([-1.0, 1.0, -1.0]), np.zeros(3))
    assert of(FIRST, SECOND, behind) == 0.0


def test_without_common_depth_nothing_is_told() -> None:
    farther = replace(SECOND, depth=1.2 * SECOND.depth)
    assert of(FIRST, farther) == of(farther, FIRST, invert_rigid(TRUE)) == 0.0
    blind = replace(SECOND, depth=np.full_like(SECOND.depth, np.nan))
    assert of(FIRST, blind) == 0.0
    plain = replace(SECOND, brightness=np.full_like(SECOND.brightness, 0.5))
    assert of(plain, plain, np.eye(4)) == 0.0
    few = np.where(np.arange(SECOND.depth.size).reshape(SECOND.depth.shape) < 300, 1, np.nan)
    assert of(FIRST, replace(SECOND, depth=(few * SECOND.depth).astype(np.float32))) == 0.0


def test_rows_are_compared_where_the_camera_was_when_it_read_them() -> None:
    moving = replace(SECOND, turn=np.array([0.02, 0.03, 0.0]), shift=np.full(3, 0.01))
    # What a camera with this motion sees of the same scene: each row from its own pose.
    rows = np.arange(SECOND.depth.shape[0])
    seen = np.empty_like(SECOND.brightness), np.empty_like(SECOND.depth)
    for row in rows:
        moment = (row + 0.5) / len(rows) - 0.5
        at_row = rigid(matrix_from_rotation_vector(moment * moving.turn), moment * moving.shift)
        there = picture(TRUTH[1] @ at_row)
        seen[0][row], seen[1][row] = there.brightness[row], there.depth[row]
    rolling = replace(moving, brightness=seen[0], depth=seen[1])
    still = replace(rolling, turn=np.zeros(3), shift=np.zeros(3))
    assert of(FIRST, rolling) > 0.95
    assert of(FIRST, rolling) > of(FIRST, still) + 0.1


def test_pairs_left_out_early_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    poses = ring_of_poses(24)
    pictures = [picture(pose).at_most(40) for pose in poses]
    whole = overlapping_pairs(pictures, poses)
    monkeypatch.setattr(agreement, "SCREENED", 16)
    np.testing.assert_array_equal(overlapping_pairs(pictures, poses), whole)
    assert 0 < len(whole) < 24 * 23
