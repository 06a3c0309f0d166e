"""Simulated walks against a recorded one."""

import numpy as np
import pytest

from digs_warp.sim.camera.walk.settings import WalkSettings
from digs_warp.study.hand_motion import (
    RECORDED,
    TimedPoses,
    figures,
    recorded_walk,
    simulated_figures,
    simulated_walk,
)
from digs_warp.study.scenes import sample_data

SEEDS = range(8)


def test_the_figures_of_a_perfect_orbit_are_those_of_its_geometry() -> None:
    times = np.arange(0.0, 30.0, 1.5)
    still = WalkSettings(unsteadiness=0.0, shake=0.0)
    found = figures(simulated_walk(times, still, 0))
    assert found.pop("speed [m/s]: mean") == pytest.approx(0.2, rel=0.01)
    assert max(found.values()) < 0.05
    walk = simulated_walk(times, still, 0)
    walk.world_from_cam[:, :3, 3] *= 1 + 0.1 * np.sin(2 * np.pi * times / 15)[:, None]
    assert figures(TimedPoses(times, walk.world_from_cam))["distance [%]: RMS"] == pytest.approx(
        10 / np.sqrt(2), rel=0.1
    )


@pytest.mark.skipif(not (sample_data() / RECORDED).is_file(), reason="no sample data")
def test_simulated_hands_wander_as_a_recorded_one_does() -> None:
    """Within a factor of 1.8 in every figure; a walk with nothing but shake is far off in most."""
    walk = recorded_walk(sample_data())
    recorded = figures(walk)
    simulated = simulated_figures(walk.times, seeds=SEEDS)
    shaken = simulated_figures(walk.times, WalkSettings(unsteadiness=0.0), seeds=SEEDS)
    for name, value in recorded.items():
        limit = 2.2 if name == "speed [%]: RMS" else 1.8  # whole walks differ most in their pace
        assert value / limit < simulated[name].mean() < limit * value, name
    off = [name for name, value in recorded.items() if shaken[name].mean() < value / 1.8]
    assert len(off) > 0.8 * len(recorded)
