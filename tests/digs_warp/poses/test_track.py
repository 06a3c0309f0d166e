"""Poses from color and depth alone: their error, loops, and recordings that do not hold together."""

import numpy as np
import pytest

from digs_warp.camera import Camera
from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.geometry import invert_rigid, matrix_from_rotation_vector, rigid
from digs_warp.poses.align import in_place
from digs_warp.poses.edges import disagreement, edge_between
from digs_warp.poses.track import track
from digs_warp.poses.tracking import check_depth
from reference.optional import open3d_or_skip
from reference.textured_plane import INTRINSICS, picture, ring_of_poses

TRUTH = ring_of_poses(16)
PICTURES = [picture(pose) for pose in TRUTH]


def frames_in(order: list[int]) -> list[Frame]:
    """Frames without poses, in some order."""
    frames = []
    for time, number in enumerate(order):
        seen = PICTURES[number]
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


def test_frames_out_of_order_are_named() -> None:
    open3d_or_skip()
    order = [0, 1, 8, 2, 3]
    with pytest.raises(DigsError, match=r"0001 and 0008, 0008 and 0002: .* in order of time"):
        track(frames_in(order), 0.0)


def test_two_recordings_in_one_break_where_the_second_starts() -> None:
    open3d_or_skip()
    with pytest.raises(DigsError, match=r"1 of 5 steps, between frames 0002 and 0009: .* two rec"):
        track(frames_in([0, 1, 2, 9, 10, 11]), 0.0)


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
    edge = edge_between(PICTURES, 0, 1, [np.eye(4)])
    assert np.abs(edge.target_from_source - true).max() < 0.005
    assert edge.information.shape == (6, 6)
