"""Single frames with a broken pose, two recordings in one, and frames that repeat are named."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.check.odd_frames import odd_frames
from digs_warp.check.repeats import repeats
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate_in_memory
from reference.real_captures import recorded

FRAMES, WIDTH = 16, 160


@pytest.fixture(scope="module")
def good() -> Capture:
    return simulate_in_memory(
        SimulateConfig(frames=FRAMES, width=WIDTH, height=90, samples_per_pixel=1)
    )


def moved(capture: Capture, numbers: range, turn_degrees: float) -> Capture:
    """The capture with the cameras of some frames turned about the z axis of the world and lifted."""
    angle = np.deg2rad(turn_degrees)
    motion = np.eye(4)
    motion[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    motion[2, 3] = 0.1
    frames = list(capture.frames)
    for number in numbers:
        camera = frames[number].camera
        other = replace(camera, world_from_cam=motion @ camera.world_from_cam)
        frames[number] = replace(frames[number], camera=other)
    return replace(capture, frames=tuple(frames))


def test_a_good_capture_has_neither(good: Capture) -> None:
    assert odd_frames(good) == [] and repeats(good) == []


@pytest.mark.parametrize("kind", ["hololens_room_sequence", "tum_cabinet_orbit"])
def test_a_real_one_neither(sample_data: Path, kind: str) -> None:
    capture = recorded(sample_data / "rgbd" / kind, kind)
    assert odd_frames(capture) == [] and repeats(capture) == []


@pytest.mark.parametrize("number", [0, 1, 7, FRAMES - 1])
def test_a_frame_with_a_broken_pose_is_named(good: Capture, number: int) -> None:
    (found,) = odd_frames(moved(good, range(number, number + 1), 40.0))
    assert found.kind == "odd frames" and not found.is_error
    assert found.what.endswith(f"after: {good.frames[number].name}.")


def test_two_broken_frames_apart_are_both_named(good: Capture) -> None:
    capture = moved(moved(good, range(3, 4), 40.0), range(10, 11), -35.0)
    (found,) = odd_frames(capture)
    assert f"{good.frames[3].name}, {good.frames[10].name}" in found.what


def test_two_recordings_in_one_break_between_them(good: Capture) -> None:
    (found,) = odd_frames(moved(good, range(8, FRAMES), 40.0))
    assert found.kind == "break" and found.is_error
    assert f"between frames {good.frames[7].name} and {good.frames[8].name}." in found.what


def test_parts_that_see_nothing_in_common_are_told(good: Capture) -> None:
    far = np.eye(4)
    far[:3, 3] = (50.0, 0.0, 0.0)
    frames = list(good.frames)
    for number in range(9, FRAMES):
        camera = frames[number].camera
        other = replace(camera, world_from_cam=far @ camera.world_from_cam)
        frames[number] = replace(frames[number], camera=other)
    (found,) = odd_frames(replace(good, frames=tuple(frames)))
    assert found.kind == "parts" and not found.is_error
    names = [good.frames[i].name for i in (0, 8, 9, FRAMES - 1)]
    assert "frames {} to {}; {} to {}.".format(*names) in found.what


def test_a_camera_that_comes_back_has_one_part(good: Capture) -> None:
    """Looking away at once, and back at what was seen before."""
    half = FRAMES // 2
    order = [*range(0, FRAMES, half), *range(1, FRAMES, half), *range(2, FRAMES, half)]
    there_and_back = replace(good, frames=tuple(good.frames[i] for i in order))
    assert odd_frames(there_and_back) == []


def test_without_depth_or_poses_nothing_is_said(good: Capture) -> None:
    broken = moved(good, range(7, 8), 40.0)
    bare = [frame.without_layer(Layer.DEPTH) for frame in broken.frames]
    assert odd_frames(replace(broken, frames=tuple(bare))) == []
    unknown = replace(broken.about, poses_known=False)
    assert odd_frames(replace(broken, about=unknown)) == []


@pytest.mark.parametrize("noise", [0.0, 3.0])
def test_a_camera_at_rest_and_doubled_frames_are_told(good: Capture, noise: float) -> None:
    rng = np.random.default_rng(0)

    def again(number: int) -> Frame:
        frame = good.frames[number]
        image = frame.load_image() + rng.normal(0, noise, (90, WIDTH, 3))
        return frame.with_layer(Layer.IMAGE, np.clip(image, 0, 255).astype(np.uint8))

    (rest,) = repeats(replace(good, frames=tuple(again(4) for _ in range(6))))
    assert "5 frames of 6 repeat the one before" in rest.what
    (doubled,) = repeats(replace(good, frames=tuple(again(i // 2) for i in range(12))))
    assert "6 frames of 12 repeat the one before" in doubled.what
    one_pause = (*good.frames[:8], again(7), *good.frames[8:])
    assert repeats(replace(good, frames=one_pause)) == []
