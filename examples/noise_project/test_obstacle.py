"""Does it still work if the camera gets worse? On a recording of your own, with errors of a camera added."""

from pathlib import Path

import numpy as np
import pytest
from obstacle import free_distance

from digs_warp.sim.testing import each

SHELF = Path(__file__).parent / "recordings/shelf"


def distance_error(capture):
    """How far noise moves the result, at the worst frame [m]; the recorded depth counts as true."""
    return max(
        abs(free_distance(frame.load_depth()) - free_distance(frame.load_depth_true()))
        for frame in capture.frames
    )


@pytest.mark.sensor_noise(capture=SHELF, profile="zed2-720", strengths=(0, 1, 2, 4))
def test_the_robot_stops_in_time(sensor_noise):
    curve = sensor_noise.measure(distance_error)
    curve.assert_at_most({0: 0.0, 1: 0.05, 4: 0.2})  # strength 0 is the recording as it is
    curve.assert_no_cliff(largest_growth=2.0)


@pytest.mark.sensor_noise(capture=SHELF, profile="zed2-720", effects=each("quantum", "step-holes"))
def test_no_effect_alone_does_harm(sensor_noise):
    sensor_noise.measure(distance_error).assert_at_most({4: 0.1})


@pytest.mark.sensor_noise(capture=SHELF, profile="zed2-720", strengths=(0, 1))
def test_noise_opens_no_gaps(sensor_noise):
    for strength, capture in sensor_noise:
        known = np.mean([np.isfinite(frame.load_depth()).mean() for frame in capture.frames])
        assert known > 0.5, f"strength {strength}"
