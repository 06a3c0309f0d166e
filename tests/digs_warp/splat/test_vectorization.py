"""The speed of the rasterizer hangs on LLVM vectorizing two loops: fail when one falls out."""

import re
import subprocess
import sys
from pathlib import Path

COMPILE = """
import digs_warp.splat.config as config
options = config.raster_module_options
def with_remarks():
    made = options()
    made["cpu_compiler_flags"] += " -Rpass=loop-vectorize"
    return made
config.raster_module_options = with_remarks
import warp as wp
wp.config.kernel_cache_dir = {cache!r}
import digs_warp.splat.rasterize as rasterize
wp.load_module(rasterize, device="cpu")
"""

HOT_LOOP = "for x in range(_TILE):"


def test_the_loops_over_a_tile_row_are_vectorized(tmp_path: Path) -> None:
    command = [sys.executable, "-c", COMPILE.format(cache=str(tmp_path))]
    compiled = subprocess.run(command, capture_output=True, text=True, check=True)
    remarks = compiled.stdout + compiled.stderr
    vectorized = {int(n) for n in re.findall(r"\.cpp:(\d+):\d+: remark: vectorized loop", remarks)}
    (source,) = tmp_path.rglob("*rasterize*.cpp")
    lines = source.read_text().splitlines()
    loops = [i for i, line in enumerate(lines, start=1) if HOT_LOOP in line]
    assert len(loops) == 2, "one loop in the forward kernel, one in the backward kernel"
    for first in loops:
        # The loop's own test stands within a few generated lines of its source line.
        near = range(first, first + 6)
        assert vectorized.intersection(near), f"not vectorized: {lines[first - 1].strip()}"
