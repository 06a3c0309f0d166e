"""The speed of the rasterizer hangs on LLVM vectorizing its loops: fail when one falls out."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.long

REMARKS = "-Rpass=loop-vectorize"
START = "import importlib\nimport warp as wp\nwp.config.kernel_cache_dir = {cache!r}\n"
# A module of kernels, with options of its own or without.
MODULE = """
module = wp.get_module(importlib.import_module({name!r}).__name__)
flags = module.options.get("cpu_compiler_flags") or "-march=native"
module.options["cpu_compiler_flags"] = flags + " {remarks}"
wp.load_module(module, device="cpu")
"""
# A kernel that a function makes.
KERNEL = """
made = importlib.import_module("digs_warp.splat." + {name!r}.split(".")[0])
options = made.vector_module_options
flags = options()["cpu_compiler_flags"] + " {remarks}"
made.vector_module_options = lambda: options() | {{"cpu_compiler_flags": flags}}
wp.load_module(made.{call}.module, device="cpu")
"""

HOT_LOOP, OF_GROUP = "for i in range(BLOCK):", "for i in range(_GROUP):"
# One finds which blocks several splats touch, the other those that are not saturated.
FORWARD_LOOPS = (HOT_LOOP, "for member in range(GROUP):", "for (int lane = 0;")

LOOPS = {
    **{f"rasterize.forward_kernel({depths})": FORWARD_LOOPS for depths in range(3)},
    **{f"rasterize_adjoint.backward_kernel({depth})": (HOT_LOOP,) for depth in (False, True)},
    "digs_warp.train.optimizer": ("for i in range(_BLOCK):",),
    "digs_warp.losses.target": ("for xc in range(_PIECE):",),
    "digs_warp.losses.depth": ("for px in range(_PIECE):",),
    "digs_warp.splat.project_group": (OF_GROUP,),
    "digs_warp.splat.project_adjoint_group": (OF_GROUP,),
    "digs_warp.sim.render.surround_pixels": ("for i in range(PIECE):", "for j in range(PIECE):"),
    "digs_warp.train.smoothing": ("for i in range(_BLOCK):", "for k in range(_BLOCK):"),
    "digs_warp.measure.ssim": (
        "for i in range(_LINE):",
        "for (int x = 0; x < count; ++x)",
        "for (int c = 0; c < count; ++c)",
        "for col in range(_WIDE):",
        "for k in range(_COLUMNS):",
    ),
}


@pytest.mark.parametrize("name", LOOPS)
def test_the_loops_are_vectorized(name: str, tmp_path: Path) -> None:
    """Compile one module with remarks, and look for those about lines of the source."""
    of_module = name.startswith("digs_warp")
    code = START + (MODULE if of_module else KERNEL)
    call = name.split(".")[-1]
    code = code.format(cache=str(tmp_path), name=name, call=call, remarks=REMARKS)
    command = [sys.executable, "-c", code]
    compiled = subprocess.run(command, capture_output=True, text=True, check=True)
    remarks = compiled.stdout + compiled.stderr
    vectorized = {int(n) for n in re.findall(r"\.cpp:(\d+):\d+: remark: vectorized loop", remarks)}
    (source,) = tmp_path.rglob("*.cpp")
    lines = source.read_text().splitlines()
    for loop in LOOPS[name]:
        (hot,) = [i for i, line in enumerate(lines, start=1) if loop in line]
        # The loop's own test stands within a few generated lines of its source line.
        assert vectorized.intersection(range(hot, hot + 6)), f"not vectorized: {loop}"
