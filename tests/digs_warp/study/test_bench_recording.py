"""The speed of whole recordings."""

import os

import pytest

from digs_warp.study.bench_recording import recorded_alone, result_of


def test_a_recording_tells_time_cores_and_memory() -> None:
    made = recorded_alone(64, 3)
    values = result_of(64, made).values
    assert values["frames/s"] * made.seconds == pytest.approx(3)
    assert 0 < values["cores busy"] < (os.cpu_count() or 1) + 0.5
    assert values["CPU [s/frame]"] * values["frames/s"] == pytest.approx(values["cores busy"])
    assert values["peak memory [MB]"] == 0 or 100 < values["peak memory [MB]"] < 4000
