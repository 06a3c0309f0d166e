"""When a training draws motion blur, and from how many poses each photograph."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.rig import CameraMotion, Exposure
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at, matrix_from_rotation_vector, rigid
from digs_warp.train.shutter import WORTH_DRAWING, BlurPlan, plan_blur

K = Intrinsics(64, 48, 60.0, 60.0, 32.0, 24.0)
POINTS = np.random.default_rng(0).normal(size=(50, 3)) * 0.1
TURN, VELOCITY = np.array([0.3, -0.2, 0.1]), np.array([0.05, 0.1, -0.04])
MOTION = CameraMotion.of(VELOCITY, TURN)
STILL = CameraMotion.of(np.zeros(3), np.zeros(3))
START = look_at(np.array([0.8, 0.1, 0.3]), np.zeros(3), np.array([0.0, 0.0, 1.0]))


def frames(
    times: list[float | None], motion: CameraMotion | None = MOTION, apart: float = 1.0
) -> list[Frame]:
    """A frame for each exposure time."""
    return [
        Frame(f"{i:04d}", Camera(K, START), i * apart, {}, exposure=Exposure(motion, time))
        for i, time in enumerate(times)
    ]


def test_every_frame_has_the_poses_that_its_motion_needs() -> None:
    some = frames([0.001, 0.1, None, 0.4])
    plan = plan_blur(some, POINTS, None, "on")
    first, last = (
        Camera(K, START @ rigid(matrix_from_rotation_vector(t * TURN), t * VELOCITY)).project(
            POINTS
        )[0]
        for t in (-0.05, 0.05)
    )
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
    assert plan_blur(frames([0.0, None]), POINTS, 0.2, "auto").frames == 2
    assert not plan_blur(frames([0.2, 0.2]), POINTS, 0.0, "auto").drawn


@pytest.mark.parametrize(
    ("some", "why"),
    [
        (frames([0.0, 0.0]), "an exposure of 0 s"),
        (frames([None, None]), "no exposure time"),
        (frames([0.2, 0.2], None), "how the cameras of 2 frames moved"),
        (frames([0.2], None), "how the cameras of 1 frame moved"),
        (frames([0.2, 0.2], apart=0.1), r"0\.2 s is longer than the 0\.1 s between two frames"),
    ],
    ids=["instant", "unknown", "no motion", "one frame", "longer than the interval"],
)
def test_what_cannot_be_drawn_is_not_and_on_says_why(some: list[Frame], why: str) -> None:
    plan = plan_blur(some, POINTS, None, "auto")
    assert not plan.drawn and plan.of(some[0]) is None
    with pytest.raises(DigsError, match=f"--motion-blur on: .*{why}"):
        plan_blur(some, POINTS, None, "on")


def test_one_frame_and_cameras_that_do_not_move_have_an_answer() -> None:
    assert plan_blur(frames([0.2]), POINTS, None, "on").moments == 3
    still = plan_blur(frames([0.2, 0.2], STILL), POINTS, None, "on")
    assert (still.drawn, still.blur_px) == (False, 0.0)
    behind = plan_blur(frames([0.2]), POINTS + 100 * START[:3, 3], None, "on")
    assert not behind.drawn


def test_little_blur_is_drawn_only_on_demand() -> None:
    some = frames([0.05, 0.05])  # 0.7 px
    auto, demanded = (plan_blur(some, POINTS, None, setting) for setting in ("auto", "on"))
    assert auto.blur_px == demanded.blur_px == pytest.approx(0.71, abs=0.05)
    assert not auto.drawn and f"{WORTH_DRAWING:g} px are not worth drawing" in auto.because
    assert demanded.frames == 2
    assert plan_blur(frames([0.2, 0.2]), POINTS, None, "auto").frames == 2  # 2.8 px


def test_off_is_off() -> None:
    plan = plan_blur(frames([0.2]), POINTS, None, "off")
    assert plan == BlurPlan("--motion-blur off") and not plan.drawn


def test_a_frame_without_motion_is_drawn_sharp() -> None:
    some = frames([0.2, 0.2])
    some[1] = replace(some[1], exposure=Exposure(None, 0.2))
    plan = plan_blur(some, POINTS, None, "auto")
    assert plan.frames == 1 and plan.of(some[1]) is None
