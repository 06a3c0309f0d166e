"""A kernel that several threads launch at once is loaded once. The test runs in a process that may crash."""

import subprocess
import sys
from pathlib import Path

import pytest

ROUNDS = 20
CODE = f"""
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier
import numpy as np
import warp as wp
from digs_warp.device.parallel import launch_here, launch_parallel

@wp.kernel
def doubled(first: int, values: wp.array(dtype=float), found: wp.array(dtype=float)):
    i = first + wp.tid()
    for _ in range(2000):
        found[i] = 2.0 * values[i]

values = wp.array(np.arange(64, dtype=np.float32), device="cpu")
barrier = Barrier(8)

def work(number):
    found = wp.zeros(64, dtype=float, device="cpu")
    barrier.wait()
    LAUNCH
    return found.numpy()

with ThreadPoolExecutor(8) as pool:
    for number in range({ROUNDS}):  # not "_": a global of that name would be hashed with the kernel
        doubled.module.unload()
        for found in pool.map(work, range(8)):
            np.testing.assert_array_equal(found, 2 * np.arange(64))
print("done")
"""


@pytest.mark.parametrize(
    "launch",
    [
        "launch_parallel(doubled, 64, [values, found], threads=1)",
        "launch_here(doubled, 64, [0, values, found])",
    ],
)
def test_threads_share_a_module_that_none_has_loaded(tmp_path: Path, launch: str) -> None:
    script = tmp_path / "launches.py"
    script.write_text(CODE.replace("LAUNCH", launch))
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "done" in done.stdout, done.stderr[-2000:]
