"""What the figures say of the machine."""

import os

import pytest

from digs_warp.study.machine import processor, worth_of_threads


def test_the_processor_is_named_with_its_cores() -> None:
    assert f"{os.cpu_count()} cores of" in processor() or "cores" not in processor()


def test_one_thread_is_worth_one_and_more_are_worth_no_more_than_their_number() -> None:
    # Wide bounds: other programs run meanwhile.
    assert worth_of_threads(1, seconds=0.2) == pytest.approx(1.0, abs=0.6)
    assert 0.2 < worth_of_threads(2, seconds=0.2) < 4.0
