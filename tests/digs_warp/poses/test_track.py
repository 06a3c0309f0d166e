"""Poses from color and depth alone: their error, loops, and recordings that do not hold together."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.camera import Camera
from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.geometry import invert_rigid, matrix_from_rotation_vector, rigid
from digs_warp.poses.agreement import disagreement
from digs_warp.poses.align import in_place
from digs_warp.poses.edges import Sight, edge_between
from digs_warp.poses.track import track
from digs_warp.poses.tracking import check_depth
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


def test_matched_features_place_a_frame_from_the_other_side() -> None:
    open3d_or_skip()
    order = [0, 1, 8, 2]
    found = track(frames_in(order), 0.0)
    moved = in_place(found.poses, TRUTH[order], 0.7)
    assert np.linalg.norm(moved[:, :3, 3] - TRUTH[order, :3, 3], axis=1).max() < 0.004


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


def test_a_motion_is_found_from_a_start_several_degrees_off() -> None:
    open3d_or_skip()
    true = invert_rigid(TRUTH[1]) @ TRUTH[0]
    sights = [Sight.of(each) for each in PICTURES[:2]]
    edge = edge_between(sights, 0, 1, np.eye(4))
    assert np.abs(edge.target_from_source - true).max() < 0.005
    assert edge.information.shape == (6, 6)
