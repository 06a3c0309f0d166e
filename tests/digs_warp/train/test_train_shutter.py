"""What a training takes for the motion of cameras, and when it draws a rolling shutter or motion blur."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.rig import CameraMotion, Exposure
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at, matrix_from_rotation_vector, rigid
from digs_warp.train.shutter import (
    Drawn,
    MotionPlan,
    Shutter,
    plan_blur,
    plan_rows,
    with_motions,
)

K = Intrinsics(64, 48, 60.0, 60.0, 32.0, 24.0)
POINTS = np.random.default_rng(0).normal(size=(50, 3)) * 0.1
TURN, VELOCITY = np.array([0.3, -0.2, 0.1]), np.array([0.05, 0.1, -0.04])
MOTION = CameraMotion.of(VELOCITY, TURN)
STILL = CameraMotion.of(np.zeros(3), np.zeros(3))
START = look_at(np.array([0.8, 0.1, 0.3]), np.zeros(3), np.array([0.0, 0.0, 1.0]))


def moved(seconds: float, velocity: np.ndarray = VELOCITY) -> Camera:
    """The camera after some seconds of the motion."""
    motion = rigid(matrix_from_rotation_vector(seconds * TURN), seconds * velocity)
    return Camera(K, START @ motion)


def frames(count: int, apart: float, motion: CameraMotion | None = None) -> list[Frame]:
    return [
        Frame(f"{i:04d}", moved(i * apart), i * apart, {}, exposure=Exposure(motion))
        for i in range(count)
    ]


def exposed(
    times: list[float | None], motion: CameraMotion | None = MOTION, apart: float = 1.0
) -> list[Frame]:
    """A frame for each exposure time."""
    return [
        Frame(f"{i:04d}", Camera(K, START), i * apart, {}, exposure=Exposure(motion, time))
        for i, time in enumerate(times)
    ]


def test_the_image_moves_as_far_as_the_projections_of_the_points() -> None:
    readout, away = 0.02, np.array([0.05, 0.1, 1.0])
    plan = plan_rows(frames(1, 1.0, CameraMotion.of(away, TURN)), POINTS, readout, "auto")
    first, last = (moved(s, away).project(POINTS)[0] for s in (-readout / 2, readout / 2))
    wanted = np.median(np.linalg.norm(last - first, axis=1))
    assert plan.drawn and plan.moved_px == pytest.approx(wanted, rel=1e-2)
    rows = Shutter(plan).rows_of(frames(1, 1.0, MOTION)[0])
    assert rows is not None
    np.testing.assert_allclose(rows.turn, readout * TURN)
    np.testing.assert_allclose(rows.shift, readout * VELOCITY)


def test_neighbors_of_a_video_tell_the_motion() -> None:
    found = with_motions(frames(3, 1 / 30))[1].exposure.camera_motion
    assert found is not None
    np.testing.assert_allclose(found.angular_velocity, TURN, rtol=1e-3)
    by_then = matrix_from_rotation_vector(TURN / 30).T @ VELOCITY  # in the axes of the second frame
    np.testing.assert_allclose(found.velocity, by_then, rtol=1e-3)


def rows(setting: Drawn, some: list[Frame], readout: float = 0.02) -> MotionPlan:
    return plan_rows(some, POINTS, readout, setting)


def blur(setting: Drawn, some: list[Frame], time: float | None = None) -> MotionPlan:
    return plan_blur(some, POINTS, time, setting)


@pytest.mark.parametrize(
    ("plan", "why"),
    [
        (partial(rows, some=with_motions(frames(3, 1.0))), r"of 3 frames .*0\.15 s apart"),
        (partial(rows, some=with_motions(frames(1, 1.0))), "of 1 frame moved: no camera_motion"),
        (partial(rows, some=frames(2, 1.0, MOTION), readout=0.0), "--readout-time gives it"),
        (
            partial(rows, some=frames(3, 0.01, MOTION)),
            r"0\.02 s is longer than the 0\.01 s between",
        ),
        (partial(blur, some=exposed([0.0, 0.0])), "no exposure time, or 0"),
        (partial(blur, some=exposed([None, None])), "the setting exposure_time gives it"),
        (partial(blur, some=exposed([0.2, 0.2], None)), "how the cameras of 2 frames moved"),
        (partial(blur, some=exposed([0.2, 0.2], apart=0.1)), r"0\.2 s is longer than the 0\.1 s"),
    ],
)
def test_what_cannot_be_drawn_is_not_and_on_says_why(
    plan: Callable[[Drawn], MotionPlan], why: str
) -> None:
    found = plan("auto")
    assert not found.drawn and Shutter(found).rows_of(frames(1, 1.0, MOTION)[0]) is None
    assert Shutter(blur=found).blur_of(exposed([0.2])[0]) is None
    with pytest.raises(DigsError, match=f"(--rolling-shutter|--motion-blur) on: .*{why}"):
        plan("on")


def test_off_is_off_and_a_camera_that_does_not_move_needs_nothing() -> None:
    for plan, flag in ((rows, "--rolling-shutter"), (blur, "--motion-blur")):
        assert plan("off", exposed([0.2])) == MotionPlan(False, f"{flag} off")
        still = plan("auto", exposed([0.2, 0.2], STILL))
        assert not still.drawn and still.moved_px == 0.0
    assert not blur("on", exposed([0.2, 0.2], STILL)).drawn
    assert not plan_blur(exposed([0.2]), POINTS + 100 * START[:3, 3], None, "on").drawn  # behind it


def test_every_frame_has_the_poses_that_its_motion_needs() -> None:
    some = exposed([0.001, 0.1, None, 0.4])
    plan = blur("on", some)
    shutter = Shutter(blur=plan)
    first, last = (moved(t).project(POINTS)[0] for t in (-0.05, 0.05))
    pixels = np.median(np.linalg.norm(last - first, axis=1))
    assert shutter.blur_of(some[0]) is None and shutter.blur_of(some[2]) is None
    short, longer = shutter.blur_of(some[1]), shutter.blur_of(some[3])
    assert short is not None and longer is not None
    assert short.pixels == pytest.approx(pixels, rel=1e-2)
    assert (short.moments, longer.moments) == (2, 6)
    np.testing.assert_allclose(short.motion.turn, 0.1 * TURN)
    np.testing.assert_allclose(short.motion.shift, 0.1 * VELOCITY)
    assert plan.drawn and shutter.moments == 6
    assert "2 frames drawn from up to 6 poses" in plan.because


def test_little_blur_is_drawn_only_on_demand() -> None:
    some = exposed([0.05, 0.05])  # 0.7 px
    auto, demanded = blur("auto", some), blur("on", some)
    assert auto.moved_px == demanded.moved_px == pytest.approx(0.71, abs=0.05)
    assert not auto.drawn and "2 px are not worth drawing" in auto.because
    assert demanded.drawn and blur("auto", exposed([0.2, 0.2])).drawn  # 2.8 px


def test_a_frame_without_motion_is_drawn_sharp() -> None:
    some = exposed([0.2, 0.2])
    some[1] = replace(some[1], exposure=Exposure(None, 0.2))
    plan = blur("auto", some)
    assert "1 frame drawn" in plan.because and Shutter(blur=plan).blur_of(some[1]) is None
