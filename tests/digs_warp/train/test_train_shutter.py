"""What a training takes for the motion of cameras, and when it draws a rolling shutter or motion blur."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.rig import CameraMotion, Exposure
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at, matrix_from_rotation_vector, rigid
from digs_warp.train.shutter import WORTH_DRAWING, BlurPlan, plan_blur, plan_shutter, with_motions

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
    sharp = plan_blur(exposed([0.2]), POINTS, None, "off")
    assert sharp == BlurPlan("--motion-blur off") and not sharp.drawn


def exposed(
    times: list[float | None], motion: CameraMotion | None = MOTION, apart: float = 1.0
) -> list[Frame]:
    """A frame for each exposure time."""
    return [
        Frame(f"{i:04d}", Camera(K, START), i * apart, {}, exposure=Exposure(motion, time))
        for i, time in enumerate(times)
    ]


def test_every_frame_has_the_poses_that_its_motion_needs() -> None:
    some = exposed([0.001, 0.1, None, 0.4])
    plan = plan_blur(some, POINTS, None, "on")
    first, last = (moved(t).project(POINTS)[0] for t in (-0.05, 0.05))
    pixels = np.median(np.linalg.norm(last - first, axis=1))
    assert plan.of(some[0]) is None and plan.of(some[2]) is None
    blur, longer = plan.of(some[1]), plan.of(some[3])
    assert blur is not None and longer is not None
    assert blur.pixels == pytest.approx(pixels, rel=1e-2)
    assert (blur.moments, longer.moments) == (2, 6)
    np.testing.assert_allclose(blur.motion.turn, 0.1 * TURN)
    np.testing.assert_allclose(blur.motion.shift, 0.1 * VELOCITY)
    assert (plan.drawn, plan.frames, plan.moments) == (True, 2, 6)
    assert "2 frames drawn from up to 6 poses" in plan.because


def test_the_exposure_time_of_the_settings_counts_more() -> None:
    assert plan_blur(exposed([0.0, None]), POINTS, 0.2, "auto").frames == 2
    assert not plan_blur(exposed([0.2, 0.2]), POINTS, 0.0, "auto").drawn


@pytest.mark.parametrize(
    ("some", "why"),
    [
        (exposed([0.0, 0.0]), "an exposure of 0 s"),
        (exposed([None, None]), "no exposure time"),
        (exposed([0.2, 0.2], None), "how the cameras of 2 frames moved"),
        (exposed([0.2], None), "how the cameras of 1 frame moved"),
        (exposed([0.2, 0.2], apart=0.1), r"0\.2 s is longer than the 0\.1 s between two frames"),
    ],
    ids=["instant", "unknown", "no motion", "one frame", "longer than the interval"],
)
def test_what_cannot_be_drawn_is_not_and_on_says_why(some: list[Frame], why: str) -> None:
    plan = plan_blur(some, POINTS, None, "auto")
    assert not plan.drawn and plan.of(some[0]) is None
    with pytest.raises(DigsError, match=f"--motion-blur on: .*{why}"):
        plan_blur(some, POINTS, None, "on")


def test_one_frame_and_cameras_that_do_not_move_have_an_answer() -> None:
    assert plan_blur(exposed([0.2]), POINTS, None, "on").moments == 3
    still = plan_blur(exposed([0.2, 0.2], STILL), POINTS, None, "on")
    assert (still.drawn, still.blur_px) == (False, 0.0)
    behind = plan_blur(exposed([0.2]), POINTS + 100 * START[:3, 3], None, "on")
    assert not behind.drawn


def test_little_blur_is_drawn_only_on_demand() -> None:
    some = exposed([0.05, 0.05])  # 0.7 px
    auto, demanded = (plan_blur(some, POINTS, None, setting) for setting in ("auto", "on"))
    assert auto.blur_px == demanded.blur_px == pytest.approx(0.71, abs=0.05)
    assert not auto.drawn and f"{WORTH_DRAWING:g} px are not worth drawing" in auto.because
    assert demanded.frames == 2
    assert plan_blur(exposed([0.2, 0.2]), POINTS, None, "auto").frames == 2  # 2.8 px


def test_a_frame_without_motion_is_drawn_sharp() -> None:
    some = exposed([0.2, 0.2])
    some[1] = replace(some[1], exposure=Exposure(None, 0.2))
    plan = plan_blur(some, POINTS, None, "auto")
    assert plan.frames == 1 and plan.of(some[1]) is None
