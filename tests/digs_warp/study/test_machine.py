"""What the figures say of the machine."""

import os
from collections.abc import Callable

import pytest

from digs_warp.study import machine


def test_the_processor_is_named_with_its_cores() -> None:
    assert f"{os.cpu_count()} cores of" in machine.processor() or "cores" not in machine.processor()


def test_a_thread_gets_products_done() -> None:
    assert machine._products_per_second(0.05) > 0


@pytest.mark.parametrize(
    ("rate", "worth"),
    [
        (lambda running: 50.0, 3.0),  # three cores
        (lambda running: 50.0 / running, 1.0),  # one core that the threads share
    ],
)
def test_threads_are_worth_their_products_over_those_of_one(
    monkeypatch: pytest.MonkeyPatch, rate: Callable[[int], float], worth: float
) -> None:
    # The rates are given: other programs on the machine change measured ones at any moment.
    calls: list[float] = []

    def given(seconds: float) -> float:
        calls.append(seconds)
        return rate(1 if len(calls) == 1 else 3)

    monkeypatch.setattr(machine, "_products_per_second", given)
    assert machine.worth_of_threads(3, seconds=0.1) == pytest.approx(worth)
    assert calls == [0.1] * 4
