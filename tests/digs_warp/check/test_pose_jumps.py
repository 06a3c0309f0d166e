"""A jump of the poses is noticed without depth; poses that are right, or a little off, draw no finding."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.check.full_check import check_fully
from digs_warp.check.pose_jumps import USUAL, WRONG, agreeing_shares, pose_jumps
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.sim.camera.walk.settings import WalkSettings
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate_in_memory
from reference.real_captures import recorded
from reference.wrong_captures import each_frame, with_a_jump

FRAMES = 12
MARGIN = 1.3


@pytest.fixture(scope="module")
def photographs() -> Capture:
    """An arc around the built-in object in its room, without depth and masks."""
    walk = WalkSettings(path="arc", elevations=(30.0,))
    config = SimulateConfig(frames=FRAMES, width=320, height=180, samples_per_pixel=1, walk=walk)
    return bare(simulate_in_memory(config))


def bare(capture: Capture) -> Capture:
    return each_frame(capture, lambda f: f.without_layer(Layer.DEPTH).without_layer(Layer.MASK))


@pytest.mark.parametrize(("shift", "turn"), [((0.0, 0.0, 0.1), 0.0), ((0.5, -0.2, 0.0), 40.0)])
def test_a_jump_is_named(
    photographs: Capture, shift: tuple[float, float, float], turn: float
) -> None:
    jumping = with_a_jump(photographs, shift, turn)
    (found,) = check_fully(jumping).findings
    assert found.kind == "pose jump" and not found.is_error
    before, after = (photographs.frames[FRAMES // 2 + i].name for i in (-1, 0))
    assert f"between frames {before} and {after}:" in found.what


def test_right_poses_have_none(photographs: Capture) -> None:
    assert check_fully(photographs).findings == ()
    shares = [share for share in agreeing_shares(photographs.frames) if share is not None]
    assert len(shares) > FRAMES / 2
    assert min(shares) > MARGIN * WRONG and np.median(shares) > MARGIN * USUAL


def test_depth_and_unknown_poses_are_left_to_others(photographs: Capture) -> None:
    jumping = with_a_jump(photographs, (0.0, 0.0, 0.1), 0.0)
    assert pose_jumps(replace(jumping, about=replace(jumping.about, poses_known=False))) == []
    depth = np.ones((180, 320), np.float32)
    assert pose_jumps(each_frame(jumping, lambda f: f.with_layer(Layer.DEPTH, depth))) == []


def test_a_real_room_without_its_depth_has_none_until_it_jumps(sample_data: Path) -> None:
    room = bare(recorded(sample_data / "rgbd" / "hololens_room_sequence", "hololens_room_sequence"))
    assert check_fully(room).findings == ()
    (found,) = pose_jumps(with_a_jump(room, (0.3, 0.0, 0.2), 20.0))
    assert found.kind == "pose jump"
