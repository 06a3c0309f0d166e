"""Time and memory of a piece of work."""

import os
import subprocess
import sys
import threading
import time

import pytest

from digs_warp.study.timing import Stopwatch, best_ms, ms_side_by_side


def peak_growth_mb(work: str) -> float:
    """Run a block in a new process: a large one may serve it from memory that it holds already."""
    if not os.access("/proc/self/clear_refs", os.W_OK):
        pytest.skip("this system does not let a process forget its peak memory")
    code = (
        "import numpy as np\n"
        "from digs_warp.study.timing import peak_memory\n"
        "with peak_memory() as earlier:\n"
        "    np.ones(25_000_000).sum()\n"
        "with peak_memory() as memory:\n"
        f"    {work}\n"
        "print(memory.growth / 1e6)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return float(done.stdout)


def test_memory_that_is_held_counts() -> None:
    assert peak_growth_mb("block = np.ones(12_000_000)") == pytest.approx(96, abs=20)


def test_memory_that_is_given_back_counts() -> None:
    assert peak_growth_mb("np.ones(12_000_000).sum()") == pytest.approx(96, abs=20)


def test_the_peak_of_an_earlier_block_does_not_count() -> None:
    assert peak_growth_mb("pass") < 10


def test_the_shortest_call_counts_without_what_runs_before_it() -> None:
    ticks = iter([0.0, 5.0, 10.0, 12.0, 20.0, 23.0])
    prepared = []
    best = best_ms(lambda: None, 3, lambda: prepared.append(1), clock=lambda: next(ticks))
    assert best == 2000.0 and len(prepared) == 3


def test_a_stopwatch_keeps_the_time_of_a_block_that_fails() -> None:
    watch = Stopwatch()
    with pytest.raises(ValueError, match="late"), watch:
        raise ValueError("late")
    assert watch.seconds > 0


def test_calls_side_by_side_share_the_time_and_the_first_does_not_count() -> None:
    calls = []
    together = threading.Barrier(4)

    def slow_at_first() -> None:
        calls.append(len(calls))
        if len(calls) > 1:
            together.wait(timeout=120)  # breaks where they come one after the other
        time.sleep(0.05 if len(calls) > 1 else 0.5)

    watch = Stopwatch()
    with watch:
        wall, cpu = ms_side_by_side(slow_at_first, calls=4, rounds=2)
    assert len(calls) == 1 + 4 * 2
    # However long the rounds take on a busy machine: the shorter one is half of their time at most.
    assert 49 <= 4 * wall <= (1e3 * watch.seconds - 500) / 2
    assert cpu < wall
