"""The sensor's speed hangs on LLVM turning the loops over pieces of rows into vector code."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

# How many loops over a piece of a row are vector code; what only sets a value needs no loop.
KERNELS = {
    "digs_warp.sim.sensor.steps": 1,
}


@pytest.mark.parametrize("module", KERNELS)
def test_the_loops_over_pieces_of_rows_are_vectorized(module: str, tmp_path: Path) -> None:
    code = f"""
import importlib
import warp as wp
wp.config.kernel_cache_dir = {str(tmp_path)!r}
module = importlib.import_module({module!r})
flags = wp.get_module_options(module)["cpu_compiler_flags"] + " -Rpass=loop-vectorize"
wp.set_module_options({{"cpu_compiler_flags": flags}}, module)
wp.load_module(module, device="cpu")
"""
    command = [sys.executable, "-c", code]
    compiled = subprocess.run(command, capture_output=True, text=True, check=True)
    remarks = compiled.stdout + compiled.stderr
    vectorized = set(re.findall(r"\.cpp:(\d+):\d+: remark: vectorized loop", remarks))
    assert len(vectorized) == KERNELS[module]
