"""When frames are taken, and settings that contradict."""

import pytest

from digs_warp.checks import DigsError
from digs_warp.sim.camera.walk.settings import WalkSettings
from digs_warp.sim.config import SimulateConfig


def test_rate_and_duration_give_the_number_of_frames_and_two_of_three_are_enough() -> None:
    assert SimulateConfig().frame_count == 60
    assert SimulateConfig(frames=7).frame_count == 7
    assert SimulateConfig(walk=WalkSettings(fps=30.0)).frame_count == 60
    both = WalkSettings(fps=30.0, duration=4.0)
    assert SimulateConfig(walk=both).frame_count == 120
    with pytest.raises(DigsError, match=r"--frames 9, --fps 30 and --duration 4: .* leave one out"):
        SimulateConfig(frames=9, walk=both)
    with pytest.raises(DigsError, match=r"--fps 1000 for --duration 1000: --frames: 1000000"):
        SimulateConfig(walk=WalkSettings(fps=1000.0, duration=1000.0))
    with pytest.raises(DigsError, match=r"--fps 0.1 for --duration 1: --frames: 0"):
        SimulateConfig(walk=WalkSettings(fps=0.1, duration=1.0))
