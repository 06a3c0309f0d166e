"""What a training takes for the motion of the cameras, and when it draws a rolling shutter."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.rig import CameraMotion, Exposure
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at, matrix_from_rotation_vector, rigid
from digs_warp.train.shutter import plan_shutter, with_motions

K = Intrinsics(64, 48, 60.0, 60.0, 32.0, 24.0)
POINTS = np.random.default_rng(0).normal(size=(50, 3)) * 0.1
TURN, VELOCITY = np.array([0.3, -0.2, 0.1]), np.array([0.05, 0.1, -0.04])
MOTION = CameraMotion.of(VELOCITY, TURN)
STILL = CameraMotion.of(np.zeros(3), np.zeros(3))
START = look_at(np.array([0.8, 0.1, 0.3]), np.zeros(3), np.array([0.0, 0.0, 1.0]))


def moved(seconds: float) -> Camera:
    """The camera after some seconds of the motion."""
    motion = rigid(matrix_from_rotation_vector(seconds * TURN), seconds * VELOCITY)
    return Camera(K, START @ motion)


def frames(count: int, apart: float, motion: CameraMotion | None = None) -> list[Frame]:
    return [
        Frame(f"{i:04d}", moved(i * apart), i * apart, {}, exposure=Exposure(motion))
        for i in range(count)
    ]


def test_the_image_moves_as_far_as_the_projections_of_the_points() -> None:
    readout = 0.02
    plan = plan_shutter(frames(1, 1.0, MOTION), POINTS, readout, "auto")
    first, last = (moved(s).project(POINTS)[0] for s in (-readout / 2, readout / 2))
    wanted = np.median(np.linalg.norm(last - first, axis=1))
    assert plan.rolling
    assert plan.skew_px == pytest.approx(wanted, rel=1e-2)
    rows = plan.rows_of(frames(1, 1.0, MOTION)[0])
    assert rows is not None
    np.testing.assert_allclose(rows.turn, readout * TURN)
    np.testing.assert_allclose(rows.shift, readout * VELOCITY)


def test_neighbors_of_a_video_tell_the_motion() -> None:
    found = with_motions(frames(3, 1 / 30))[1].exposure.camera_motion
    assert found is not None
    np.testing.assert_allclose(found.angular_velocity, TURN, rtol=1e-3)
    by_then = matrix_from_rotation_vector(TURN / 30).T @ VELOCITY  # in the axes of the second frame
    np.testing.assert_allclose(found.velocity, by_then, rtol=1e-3)


def test_a_recorded_motion_counts_more_than_neighbors() -> None:
    some = frames(3, 1 / 30)
    some[1] = replace(some[1], exposure=Exposure(STILL))
    assert with_motions(some)[1].exposure.camera_motion == STILL


def test_neighbors_may_come_in_any_order() -> None:
    some = frames(4, 1 / 30)
    shuffled = [some[i] for i in (2, 0, 3, 1)]
    by_name = {frame.name: frame.exposure for frame in with_motions(some)}
    assert {frame.name: frame.exposure for frame in with_motions(shuffled)} == by_name


@pytest.mark.parametrize("some", [frames(3, 1.0), frames(1, 1.0)], ids=["far apart", "one frame"])
def test_without_motion_nothing_is_drawn_and_on_says_why(some: list[Frame]) -> None:
    plan = plan_shutter(with_motions(some), POINTS, 0.02, "auto")
    assert not plan.rolling and "camera_motion" in plan.because
    assert plan.rows_of(some[0]) is None
    with pytest.raises(DigsError, match=r"--rolling-shutter on: .*camera_motion.*0\.15 s apart"):
        plan_shutter(with_motions(some), POINTS, 0.02, "on")


def test_a_camera_that_does_not_move_needs_no_correction() -> None:
    plan = plan_shutter(frames(2, 1.0, STILL), POINTS, 0.02, "auto")
    assert not plan.rolling and plan.skew_px == 0.0


def test_no_readout_time_is_no_shutter() -> None:
    assert not plan_shutter(frames(2, 1.0, MOTION), POINTS, 0.0, "auto").rolling
    with pytest.raises(DigsError, match="--readout-time gives it"):
        plan_shutter(frames(2, 1.0, MOTION), POINTS, 0.0, "on")


def test_a_readout_cannot_be_longer_than_the_time_between_frames() -> None:
    assert not plan_shutter(frames(3, 0.01, MOTION), POINTS, 0.02, "auto").rolling
    with pytest.raises(DigsError, match=r"0\.02 s is longer than the 0\.01 s between two frames"):
        plan_shutter(frames(3, 0.01, MOTION), POINTS, 0.02, "on")


def test_off_is_off() -> None:
    plan = plan_shutter(frames(2, 1.0, MOTION), POINTS, 0.02, "off")
    assert not plan.rolling and plan.rows_of(frames(1, 1.0, MOTION)[0]) is None
