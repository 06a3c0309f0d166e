"""The benchmarks that ``digs-warp bench NAME`` knows."""

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from digs_warp.study.results import Result, format_table, format_wide_table


@dataclass(frozen=True)
class Benchmark:
    """A named measurement; functions are given as "module:function".

    Attributes:
        name: as the command line takes it.
        function: takes nothing and returns a list of `Result`.
        summary: one line for the help.
        wide: whether its table has one column per name of a result.
        plot_function: takes the results and returns a picture as PNG bytes; empty: there is none.
    """

    name: str
    function: str
    summary: str
    wide: bool = False
    plot_function: str = ""

    def run(self) -> list[Result]:
        """Import the module and measure."""
        return _load(self.function)()

    def table(self, results: list[Result]) -> str:
        """Return the results as text."""
        return format_wide_table(results) if self.wide else format_table(results)

    def plot(self, results: list[Result]) -> bytes:
        """Return the results as a PNG file; only where there is a ``plot_function``."""
        return _load(self.plot_function)(results)


def _load(name: str) -> Callable[..., Any]:
    module, _, function = name.partition(":")
    return getattr(importlib.import_module(module), function)


BENCHMARKS = (
    Benchmark(
        "raster",
        "digs_warp.study.bench_raster:bench_raster",
        "the splat rasterizer: plain against vectorized, 1 and 2 threads, forward and backward",
    ),
    Benchmark(
        "scaling",
        "digs_warp.study.bench_scaling:bench_scaling",
        "how the time of a view grows with pixels, splats, overlap and threads, memory, compilation",
        plot_function="digs_warp.study.plot_scaling:plot_scaling",
    ),
    Benchmark(
        "render",
        "digs_warp.study.bench_render:bench_render",
        "the frame rate of a film of the built-in object at three image sizes, 1 thread and all",
    ),
    Benchmark(
        "train",
        "digs_warp.study.bench_train:bench_train",
        "a training step, stage by stage, at three image sizes",
    ),
    Benchmark(
        "convergence",
        "digs_warp.study.bench_convergence:bench_convergence",
        "quality of held-out views along training seconds: a dense start's settings against those of 3DGS",
        plot_function="digs_warp.study.plot_convergence:plot_convergence",
    ),
    Benchmark(
        "paper-length",
        "digs_warp.study.bench_paper_length:bench_paper_length",
        "training runs of 100, 1000 and 12,000 steps at 1600x900: seconds and quality",
    ),
    Benchmark(
        "options",
        "digs_warp.study.bench_options:bench_options",
        "what each option of the training costs in time and brings in quality",
        wide=True,
    ),
    Benchmark(
        "sfm",
        "digs_warp.study.bench_sfm:bench_sfm",
        "structure from motion: seconds, memory and pose errors of each choice (pairs, features, mapper)",
        wide=True,
    ),
    Benchmark(
        "sfm-full",
        "digs_warp.study.bench_sfm:bench_sfm_full",
        "structure from motion on 200 images of 1600x900",
        wide=True,
    ),
    Benchmark(
        "sfm-sensor",
        "digs_warp.study.bench_sfm_sensor:bench_sfm_sensor",
        "which imperfection of the camera costs structure from motion its exactness",
        wide=True,
    ),
    Benchmark(
        "masks",
        "digs_warp.study.bench_masks:bench_masks",
        "object masks without a network against the true ones",
        wide=True,
    ),
    Benchmark(
        "init",
        "digs_warp.study.bench_init:bench_init",
        "from 200 depth maps of 2208x1242 to points: seconds, memory, distance to the true surface",
    ),
    Benchmark(
        "init-noise",
        "digs_warp.study.init_strategies:init_strategies",
        "all initializations at rising sensor noise and with calibration errors, against true surfaces",
        wide=True,
    ),
    Benchmark(
        "usd",
        "digs_warp.study.bench_usd:bench_usd",
        "USD scenes of a million splats: write, read, validate; what each precision saves and loses",
        wide=True,
    ),
    Benchmark(
        "mesh",
        "digs_warp.study.bench_mesh:bench_mesh",
        "the mesh of the built-in object at four voxel sizes: seconds, triangles, distance to the truth",
        wide=True,
    ),
    Benchmark(
        "splat-files",
        "digs_warp.study.bench_splat_files:bench_splat_files",
        "PLY, SPZ, .splat, USD: bytes, seconds to write and read, and what is lost to the eye",
        wide=True,
    ),
    Benchmark(
        "sim",
        "digs_warp.study.bench_sim:bench_sim",
        "the simulated depth sensor: time and scores of every tier and effect, against real matching",
        wide=True,
        plot_function="digs_warp.study.plot_sim:plot_sim",
    ),
)
