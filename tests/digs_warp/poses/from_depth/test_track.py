"""Poses from color and depth alone: their error, loops, and recordings that do not hold together."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import invert_rigid, matrix_from_rotation_vector, rigid
from digs_warp.poses import thresholds
from digs_warp.poses.agreement import disagreement
from digs_warp.poses.from_depth.estimate import holds, track
from digs_warp.poses.from_depth.pair_motion import FrameFeatures, FramePair
from digs_warp.poses.outcome import check_depth
from digs_warp.poses.refine.photometric_alignment import in_place
from digs_warp.poses.views import Picture
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


def test_frames_disagree_less_the_nearer_a_motion_is_to_the_true_one() -> None:
    true = invert_rigid(TRUTH[1]) @ TRUTH[0]
    off = [
        disagreement(
            PICTURES[0],
            PICTURES[1],
            true @ rigid(matrix_from_rotation_vector(np.array([0.0, angle, 0.0])), np.zeros(3)),
        )
        for angle in np.radians([0.0, 1.0, 4.0])
    ]
    assert off == sorted(off)
    assert off[0] < 0.6
    behind = rigid(np.diag([-1.0, 1.0, -1.0]), np.zeros(3))
    assert disagreement(PICTURES[0], PICTURES[1], behind) == pytest.approx(1.2)


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


def test_a_step_to_another_place_does_not_hold_in_any_light() -> None:
    open3d_or_skip()
    for seed, exposure in enumerate((0.7, 1.0, 1.4)):
        pair = [
            in_bad_light(PICTURES[0], 1.0, seed),
            in_bad_light(ELSEWHERE[0], exposure, seed + 10),
        ]
        edge = FramePair.of([FrameFeatures.of(each) for each in pair], 0, 1).edge(np.eye(4))
        assert edge.correlation < thresholds.MIN_STEP_CORRELATION - 0.2
        assert not holds(edge)


def test_the_same_poses_come_from_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    open3d_or_skip()
    frames = frames_in([0, 1, 2, 3, 2, 1])
    found = []
    for threads in ("1", "2", "3"):
        monkeypatch.setenv("DIGS_WARP_THREADS", threads)
        found.append(track(frames, 0.0))
    assert all((each.poses == found[0].poses).all() for each in found)
    assert all(each.tracking == found[0].tracking for each in found)
