"""When frames are taken: an even beat, jitter, frames that are lost, and settings that contradict."""

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.sim.camera.walk.settings import WalkSettings, frame_moments
from digs_warp.sim.config import SimulateConfig


def test_frames_are_spread_evenly_over_the_walk() -> None:
    assert frame_moments(4, WalkSettings(), 10.0, 0) == (0.0, 2.5, 5.0, 7.5)
    assert frame_moments(1, WalkSettings(), 10.0, 0) == (0.0,)


def test_a_rate_sets_how_far_apart_they_are() -> None:
    moments = frame_moments(4, WalkSettings(fps=20.0), 10.0, 0)
    np.testing.assert_allclose(moments, [0.0, 0.05, 0.1, 0.15])


def test_jitter_strays_by_as_much_as_it_says_and_keeps_the_order() -> None:
    settings = WalkSettings(fps=30.0, time_jitter=0.005)
    moments = np.array(frame_moments(2000, settings, 100.0, 1))
    strayed = moments - np.arange(2000) / 30
    assert strayed[0] == 0
    assert strayed.std() == pytest.approx(0.005, rel=0.1)
    assert (np.diff(moments) > 0).all()
    assert frame_moments(2000, settings, 100.0, 1) == tuple(moments)
    assert frame_moments(2000, settings, 100.0, 2) != tuple(moments)


def test_jitter_that_would_change_the_order_is_refused() -> None:
    with pytest.raises(DigsError, match=r"time_jitter 0\.02: .*expected less than 0\.00556"):
        frame_moments(10, WalkSettings(fps=30.0, time_jitter=0.02), 10.0, 0)


def test_lost_frames_leave_gaps() -> None:
    settings = WalkSettings(fps=10.0, dropped_frames=0.2)
    assert all(frame_moments(50, settings, 5.0, seed)[0] == 0 for seed in range(30))
    moments = np.array(frame_moments(50, settings, 5.0, 0))
    assert len(moments) == 40
    beats = np.round(moments * 10)
    np.testing.assert_allclose(moments, beats / 10)
    assert len(set(beats)) == 40
    kept = SimulateConfig(frames=50, walk=settings)
    assert (kept.beats, kept.frame_count) == (50, 40)
    assert SimulateConfig(frames=1, walk=WalkSettings(dropped_frames=0.9)).frame_count == 1


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


def test_a_rate_gives_the_duration_of_so_many_frames() -> None:
    assert WalkSettings(fps=10.0).for_frames(30).duration == 3.0
    assert WalkSettings(fps=10.0, duration=5.0).for_frames(50).duration == 5.0
    assert WalkSettings().for_frames(30).duration is None
