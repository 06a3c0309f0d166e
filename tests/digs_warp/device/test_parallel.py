# Warp types its kernel language only in part:
# pyright: reportOperatorIssue=false, reportIndexIssue=false, reportArgumentType=false
"""Launches shared out over threads: every index once, the same bits for any number of threads."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from digs_warp.device.parallel import (
    ParallelLaunch,
    default_threads,
)

wp.set_module_options({"enable_backward": False})

DIMS = [1, 2, 7, 8, 15, 16, 17, 31, 64, 100, 1000, 1001]


@wp.kernel
def count_visits(first: int, visits: wp.array[int], seen: wp.array[int]):
    index = first + wp.tid()
    visits[index] = visits[index] + 1
    seen[index] = index


@wp.kernel
def rough_sum(first: int, values: wp.array[float], scale: float, sums: wp.array[float]):
    index = first + wp.tid()
    total = float(0.0)  # a variable that changes in a loop
    for k in range(values.shape[0]):
        total += wp.sin(values[k] * float(index + 1)) * scale
    sums[index] = total


@pytest.mark.parametrize("threads", [1, 2, 3, 8])
def test_every_index_is_visited_exactly_once_per_run(threads: int) -> None:
    for dim in DIMS:
        visits = wp.zeros(dim, dtype=wp.int32, device="cpu")
        seen = wp.zeros(dim, dtype=wp.int32, device="cpu")
        launch = ParallelLaunch(count_visits, dim, [visits, seen], threads=threads)
        for runs in (1, 2):
            launch.run()
            assert visits.numpy().tolist() == [runs] * dim
        assert seen.numpy().tolist() == list(range(dim))


def sums(threads: int) -> np.ndarray:
    values = wp.array(np.random.default_rng(0).normal(size=300).astype(np.float32), device="cpu")
    found = wp.zeros(777, dtype=wp.float32, device="cpu")
    launch = ParallelLaunch(rough_sum, 777, [values, 9.0, found], threads=threads)
    launch.set_param(1, 0.5)
    launch.run()
    return found.numpy().copy()


@pytest.mark.parametrize("threads", [2, 5])
def test_same_bits_for_any_number_of_threads(threads: int) -> None:
    np.testing.assert_array_equal(sums(1).view(np.uint32), sums(threads).view(np.uint32))


def test_the_environment_sets_the_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DIGS_WARP_THREADS", "3")
    assert default_threads() == 3
    assert ParallelLaunch(count_visits, 0, []).threads == 3
    monkeypatch.delenv("DIGS_WARP_THREADS")
    assert default_threads() >= 1


def test_an_exception_in_any_thread_reaches_the_caller() -> None:
    class Broken:
        def launch(self) -> None:
            raise RuntimeError("broken chunk")

    visits = wp.zeros(8, dtype=wp.int32, device="cpu")
    launch = ParallelLaunch(count_visits, 8, [visits, visits], threads=2)
    launch.chunks.append(Broken())
    with pytest.raises(RuntimeError, match="broken chunk"):
        launch.run()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_a_forked_process_has_threads_of_its_own(tmp_path: Path) -> None:
    """As the workers of PyTorch's data loaders, after their parent has used the threads."""
    script = tmp_path / "fork.py"
    script.write_text(
        "import os, signal\n"
        "import numpy as np, warp as wp\n"
        "from digs_warp.device.parallel import launch_parallel\n"
        "@wp.kernel\n"
        "def double(first: int, values: wp.array[float]):\n"
        "    values[first + wp.tid()] *= 2.0\n"
        "def work():\n"
        "    values = wp.ones(100, dtype=float, device='cpu')\n"
        "    launch_parallel(double, 100, [values], threads=4)\n"
        "    assert (values.numpy() == 2).all()\n"
        "[work() for _ in range(20)]\n"
        "if (child := os.fork()) == 0:\n"
        "    signal.alarm(30)\n"
        "    work()\n"
        "    os._exit(0)\n"
        "raise SystemExit(os.waitpid(child, 0)[1])\n"
    )
    done = subprocess.run([sys.executable, script], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
