"""Time and memory of a piece of work."""

import os
import subprocess
import sys
import time

import numpy as np
import pytest

from digs_warp.study.timing import Stopwatch, best_ms, ms_side_by_side, peak_memory


def test_the_peak_counts_and_not_what_is_left():
    size = 100_000_000
    with peak_memory() as memory:
        np.ones(size, dtype=np.uint8).sum()
    if not memory.start:
        pytest.skip("no /proc here")
    assert 0.9 * size < memory.growth < 1.5 * size
    with peak_memory() as nothing:
        pass
    assert nothing.growth < 0.1 * size


def test_peak_memory_sees_what_a_block_took() -> None:
    with peak_memory() as memory:
        block = np.ones(30_000_000)
        total = sum(float(block.sum()) for _ in range(10))
    if not memory.start:
        pytest.skip("no /proc here")
    assert total == 3e8
    assert memory.peak - memory.start > 0.9 * block.nbytes


def test_memory_held_for_a_moment_counts() -> None:
    """In a separate process: a large one may serve the block from memory that it holds already."""
    if not os.access("/proc/self/clear_refs", os.W_OK):
        pytest.skip("this system does not let a process forget its peak memory")
    code = (
        "import numpy as np\n"
        "from digs_warp.study.timing import peak_memory\n"
        "with peak_memory() as memory:\n"
        "    block = np.ones(12_000_000)\n"
        "    del block\n"
        "print(memory.growth / 2**20)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert float(done.stdout) == pytest.approx(91.6, abs=20)


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

    def slow_at_first() -> None:
        calls.append(len(calls))
        time.sleep(0.05 if len(calls) > 1 else 0.5)

    wall, cpu = ms_side_by_side(slow_at_first, calls=4, rounds=2)
    assert len(calls) == 1 + 4 * 2
    assert 12 < wall < 45  # 50 ms for four
    assert cpu < wall
