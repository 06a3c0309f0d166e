"""Where the search for the motion between two frames starts: matched features, and usual motions."""

import numpy as np
import pytest

from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.rigid import invert_rigid, look_at, matrix_from_rotation_vector, rigid
from digs_warp.poses.agreement import disagreement
from digs_warp.poses.features import Matches, features_of, matched
from digs_warp.poses.from_depth.estimate import turn_deg
from digs_warp.poses.from_depth.pair_motion import likely_starts
from reference.textured_plane import INTRINSICS, picture, ring_of_poses

TRUTH = ring_of_poses(16)
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
