"""An object on a turntable before a still camera: the check says so, and masks give the poses."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.check.check import check_capture
from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.geometry.rigid import matrix_from_rotation_vector, rigid
from digs_warp.pipeline.config import FrontEndConfig
from digs_warp.pipeline.front_end import front_end
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.record.run_log import RunLog
from digs_warp.sim.camera.walk.settings import WalkSettings
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate_in_memory
from reference.optional import open3d_or_skip
from studies.pose_errors import camera_errors

# Its recording takes a minute: light is measured anew for each place of the object.
pytestmark = pytest.mark.long

FRAMES = 24
# Of poses from the object alone, 110 pixels high, 0.9 m away [mm, degree].
# The errors of neighboring pixels are alike: all frames are turned by 1.3 degrees together.
CENTERS_MM, TURNS_DEG = 8.0, 1.6


@pytest.fixture(scope="module")
def turntable() -> Capture:
    walk = WalkSettings(path="turntable")
    size = SimulateConfig(profile="bare-matcher", width=240, height=136, samples_per_pixel=1)
    return simulate_in_memory(replace(size, frames=FRAMES, tier="law", walk=walk))


def before_the_object(capture: Capture) -> Capture:
    """The same with the true poses, in the world of the object."""

    def turned(frame: Frame, number: int) -> Frame:
        angle = -2 * np.pi * number / len(capture)
        turn = rigid(matrix_from_rotation_vector(np.array([0, 0, angle])), np.zeros(3))
        pose = turn @ frame.camera.world_from_cam
        return replace(frame, camera=replace(frame.camera, world_from_cam=pose))

    return replace(capture, frames=tuple(turned(f, n) for n, f in enumerate(capture.frames)))


def without_masks(capture: Capture) -> Capture:
    return replace(capture, frames=tuple(f.without_layer(Layer.MASK) for f in capture.frames))


def test_the_check_fails_with_the_cure(turntable: Capture) -> None:
    unknown = replace(turntable, about=replace(turntable.about, poses_known=False))
    for capture in (turntable, unknown, without_masks(turntable)):
        found = check_capture(capture)
        assert found.has_errors and found.findings[0].kind == "still camera"
        assert re.search("masks.*--poses auto.*board:FILE", found.findings[0].remedy)


def test_poses_before_the_object_are_right(turntable: Capture) -> None:
    found = check_capture(before_the_object(turntable))
    assert not found.has_errors and found.agreement is not None and found.agreement.score > 0.5


def test_masks_give_the_poses(turntable: Capture, tmp_path: Path) -> None:
    open3d_or_skip()
    config = FrontEndConfig(sfm=SfmConfig(poses="auto"), test_every=4)
    found = front_end(turntable, config, tmp_path, RunLog("test", {})).poses
    frames = [frame for frame, _ in found.posed.by_time]
    assert len(frames) == FRAMES and not found.errors
    assert not any(frame.alone for frame in frames)  # the training sees the photographs
    cameras = {frame.name: frame.camera for frame in frames}
    errors = camera_errors(cameras, before_the_object(turntable).frames)
    assert 1e3 * np.median(errors.centers_m) < CENTERS_MM
    assert np.median(errors.rotations_deg) < TURNS_DEG
    first = turntable.frames[0].camera
    assert np.allclose(frames[0].camera.world_from_cam, first.world_from_cam, atol=1e-6)


@pytest.mark.parametrize("poses", ["capture", "auto"])
def test_without_masks_or_poses_it_is_refused(
    turntable: Capture, tmp_path: Path, poses: Any
) -> None:
    config = FrontEndConfig(sfm=SfmConfig(poses=poses))
    bare = turntable if poses == "capture" else without_masks(turntable)
    with pytest.raises(DigsError, match=r"stands still.*masks.*--poses auto"):
        front_end(bare, config, tmp_path, RunLog("test", {}))
