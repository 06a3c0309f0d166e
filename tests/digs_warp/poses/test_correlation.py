"""Details of two frames compared: in another light, in noise, with a rolling shutter, on wrong motions."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.geometry.rigid import invert_rigid, matrix_from_rotation_vector, rigid
from digs_warp.poses.agreement import correlation
from digs_warp.poses.views import Picture, view_of
from reference.textured_plane import picture, ring_of_poses

TRUTH = ring_of_poses(16)
FIRST, SECOND = (picture(pose) for pose in TRUTH[:2])
TRUE = invert_rigid(TRUTH[1]) @ TRUTH[0]


def of(first: Picture, second: Picture, motion: np.ndarray = TRUE) -> float:
    return correlation(view_of(first), view_of(second), motion)


def test_details_match_under_the_true_motion_in_any_light() -> None:
    darker = replace(SECOND, brightness=0.1 + 0.5 * SECOND.brightness)
    assert of(FIRST, SECOND) > 0.98
    assert of(FIRST, darker) == pytest.approx(of(FIRST, SECOND), abs=0.01)


def test_noise_takes_some_of_it() -> None:
    rng = np.random.default_rng(0)
    noise = [rng.normal(0, 0.1, each.brightness.shape) for each in (FIRST, SECOND)]
    first, second = [
        replace(each, brightness=(each.brightness + more).astype(np.float32))
        for each, more in zip((FIRST, SECOND), noise, strict=True)
    ]
    assert 0.7 < of(first, second) < 0.95


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
