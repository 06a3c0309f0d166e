"""Single frames in a wrong place are left out; good recordings stay as they are."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import digs_warp as dw
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.geometry.rigid import matrix_from_rotation_vector, rigid, turn_degrees
from digs_warp.poses.agreement import reduced
from digs_warp.poses.refine.refine import contradicted, refine
from digs_warp.poses.views import load_pictures
from reference.perturbed_poses import perturbed_capture

WRONG = 3
SETTINGS: dict[str, Any] = {"profile": "bare-matcher", "width": 320, "tier": "law", "seed": 3}


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """Half a turn around the built-in object."""
    out = tmp_path_factory.mktemp("arc") / "capture"
    return dw.simulate(frames=12, camera_path="arc", elevations=(20.0,), out=out, **SETTINGS)


def poses_of(frames: Sequence[Frame]) -> np.ndarray:
    return np.stack([frame.camera.world_from_cam for frame in frames])


def turned(frame: Frame, degrees: float = 20.0) -> Frame:
    """A camera elsewhere, round the vertical axis of the world, and looking elsewhere."""
    turn = rigid(matrix_from_rotation_vector(np.radians([0.0, 0.0, degrees])), np.zeros(3))
    aside = rigid(matrix_from_rotation_vector(np.array([0.0, 0.1, 0.0])), np.zeros(3))
    pose = turn @ frame.camera.world_from_cam @ aside
    return replace(frame, camera=replace(frame.camera, world_from_cam=pose))


def mirrored(frame: Frame) -> Frame:
    """No camera sees the scene in a mirror."""
    for layer, values in ((Layer.IMAGE, frame.load_image()), (Layer.DEPTH, frame.load_depth())):
        frame = frame.with_layer(layer, np.ascontiguousarray(values[:, ::-1]))
    return frame


@pytest.mark.parametrize("spoil", [turned, mirrored])
def test_a_frame_that_all_others_contradict_is_left_out(capture: Capture, spoil) -> None:
    frames = list(capture.frames)
    frames[WRONG] = spoil(frames[WRONG])
    left, refinement = refine(frames, 0.0, needed=False)
    assert [f.name for f in left] == [f.name for f in frames if f is not frames[WRONG]]
    assert refinement.because.endswith(f"; left out: {frames[WRONG].name}")
    right = [frame for frame in capture.frames if frame.name != frames[WRONG].name]
    assert turn_degrees(poses_of(left)[:, :3, :3], poses_of(right)[:, :3, :3]).max() < 0.5


@pytest.mark.parametrize("light", [1.0, 0.4])
def test_good_frames_of_any_exposure_stay(capture: Capture, light: float) -> None:
    pictures, true = load_pictures(capture.frames, 0.0), poses_of(capture.frames)
    pictures[WRONG] = replace(pictures[WRONG], brightness=light * pictures[WRONG].brightness)
    assert contradicted(reduced(pictures), true) == []


def test_right_frames_stay_where_all_poses_are_off(tmp_path: Path) -> None:
    """Around the object in wide steps: one agrees with no other before all are aligned."""
    capture = dw.simulate(frames=16, camera_path="orbits", out=tmp_path / "orbits", **SETTINGS)
    frames, refinement = refine(perturbed_capture(capture, 1.0, 0.01, 2).frames, 0.0, needed=True)
    assert refinement.refined
    assert len(frames) == 16
    off = turn_degrees(poses_of(frames)[:, :3, :3], poses_of(capture.frames)[:, :3, :3])
    assert off.max() < 1.5


def test_what_too_few_frames_or_none_agree_on_is_left_alone(capture: Capture) -> None:
    frames = list(capture.frames)
    frames[WRONG] = turned(frames[WRONG])
    few = frames[WRONG : WRONG + 3]
    assert contradicted(reduced(load_pictures(few, 0.0)), poses_of(few)) == []
    rng = np.random.default_rng(1)
    lost = [turned(frame, rng.uniform(-60, 60)) for frame in capture.frames]
    assert contradicted(reduced(load_pictures(lost, 0.0)), poses_of(lost)) == []
    blind = [
        frame.without_layer(Layer.DEPTH) if frame is frames[WRONG] else frame for frame in frames
    ]
    assert contradicted(reduced(load_pictures(blind, 0.0)), poses_of(blind)) == []
