"""The benchmarks that ``digs-warp bench NAME`` knows."""

import importlib
from dataclasses import dataclass

from digs_warp.study.results import Result


@dataclass(frozen=True)
class Benchmark:
    """A named measurement; ``function`` is "module:function" and returns a list of `Result`."""

    name: str
    function: str
    summary: str

    def run(self) -> list[Result]:
        """Import the module and measure."""
        module, _, name = self.function.partition(":")
        return getattr(importlib.import_module(module), name)()


BENCHMARKS = (
    Benchmark(
        "raster",
        "digs_warp.study.bench_raster:bench_raster",
        "the splat rasterizer: plain against vectorized, 1 and 2 threads, forward and backward",
    ),
    Benchmark(
        "train",
        "digs_warp.study.bench_train:bench_train",
        "a training step, stage by stage, at three image sizes",
    ),
)
