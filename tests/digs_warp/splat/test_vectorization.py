"""The speed of the rasterizer hangs on LLVM vectorizing its loops: fail when one falls out."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.long

COMPILE = """
import warp as wp
wp.config.kernel_cache_dir = {cache!r}
import digs_warp.splat.rasterize as rasterize
import digs_warp.splat.rasterize_adjoint as rasterize_adjoint
options = rasterize.vector_module_options
def with_remarks():
    made = options()
    made["cpu_compiler_flags"] += " -Rpass=loop-vectorize"
    return made
rasterize.vector_module_options = rasterize_adjoint.vector_module_options = with_remarks
wp.load_module({kernel}.module, device="cpu")
"""

HOT_LOOP = "for i in range(BLOCK):"
# Finds which blocks several splats touch.
TOUCHED_LOOP = "for member in range(GROUP):"

KERNELS = {
    "color, forward": "rasterize.forward_kernel(0)",
    "mean depth, forward": "rasterize.forward_kernel(1)",
    "depth, forward": "rasterize.forward_kernel(2)",
    "color, backward": "rasterize_adjoint.backward_kernel(False)",
    "depth, backward": "rasterize_adjoint.backward_kernel(True)",
}


def assert_vectorized(code: str, cache: Path, *loops: str) -> None:
    """Run code that compiles one module with remarks, and look for those about lines of the source."""
    command = [sys.executable, "-c", code]
    compiled = subprocess.run(command, capture_output=True, text=True, check=True)
    remarks = compiled.stdout + compiled.stderr
    vectorized = {int(n) for n in re.findall(r"\.cpp:(\d+):\d+: remark: vectorized loop", remarks)}
    (source,) = cache.rglob("*.cpp")
    lines = source.read_text().splitlines()
    for loop in loops:
        (hot,) = [i for i, line in enumerate(lines, start=1) if loop in line]
        # The loop's own test stands within a few generated lines of its source line.
        assert vectorized.intersection(range(hot, hot + 6)), f"not vectorized: {loop}"


@pytest.mark.parametrize("name", KERNELS)
def test_the_loops_of_the_rasterizer_are_vectorized(name: str, tmp_path: Path) -> None:
    code = COMPILE.format(cache=str(tmp_path), kernel=KERNELS[name])
    loops = (HOT_LOOP, TOUCHED_LOOP) if "forward" in name else (HOT_LOOP,)
    assert_vectorized(code, tmp_path, *loops)


MODULES = {
    "digs_warp.train.optimizer": ["for i in range(_BLOCK):"],
    "digs_warp.losses.target": ["for xc in range(_PIECE):"],
    "digs_warp.losses.depth": ["for px in range(_PIECE):"],
}


@pytest.mark.parametrize("module", MODULES)
def test_the_loops_around_the_rasterizer_are_vectorized(module: str, tmp_path: Path) -> None:
    code = f"""
import importlib
import warp as wp
wp.config.kernel_cache_dir = {str(tmp_path)!r}
wp.config.cpu_compiler_flags = "-Rpass=loop-vectorize"
wp.load_module(importlib.import_module({module!r}), device="cpu")
"""
    assert_vectorized(code, tmp_path, *MODULES[module])


OWN_OPTIONS = {
    "digs_warp.splat.project_group": ["for i in range(_GROUP):"],
    "digs_warp.splat.project_adjoint_group": ["for i in range(_GROUP):"],
    "digs_warp.train.smoothing": [
        "for i in range(_BLOCK):",
        "for k in range(_BLOCK):",
    ],
    "digs_warp.measure.ssim": [
        "for i in range(_LINE):",
        "for (int x = 0; x < count; ++x)",
        "for (int c = 0; c < count; ++c)",
        "for col in range(_WIDE):",
        "for k in range(_COLUMNS):",
    ],
}


@pytest.mark.parametrize("module", OWN_OPTIONS)
def test_the_loops_of_modules_with_options_of_their_own_are_vectorized(
    module: str, tmp_path: Path
) -> None:
    code = f"""
import importlib
import warp as wp
wp.config.kernel_cache_dir = {str(tmp_path)!r}
module = wp.get_module(importlib.import_module({module!r}).__name__)
module.options["cpu_compiler_flags"] += " -Rpass=loop-vectorize"
wp.load_module(module, device="cpu")
"""
    assert_vectorized(code, tmp_path, *OWN_OPTIONS[module])
