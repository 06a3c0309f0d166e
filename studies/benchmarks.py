"""The benchmarks of ``python -m studies NAME``: what measures each, and the pages that show it."""

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from digs_warp.checks import DigsError
from digs_warp.words import did_you_mean

if TYPE_CHECKING:
    from studies.results import Result


@dataclass(frozen=True)
class Benchmark:
    """A named measurement; functions are given as "module.function" below `studies`.

    Attributes:
        name: as the command takes it.
        functions: each returns a list of `Result`; takes names out of ``cases`` where there are any.
        pages: files in docs/ that show its tables.
        cases: names of the cases, where one can measure some of them.
    """

    name: str
    functions: tuple[str, ...]
    pages: tuple[str, ...]
    cases: tuple[str, ...] = ()

    def run(self, only: Sequence[str] = ()) -> "list[Result]":
        """Measure all cases, or ``only`` some of `cases`."""
        if unknown := [name for name in only if name not in self.cases]:
            raise DigsError(
                f"{self.name}: no case '{unknown[0]}'; it has {', '.join(self.cases) or 'none'}"
            )
        arguments = [only] if only else []
        return [result for name in self.functions for result in _load(name)(*arguments)]


def _load(name: str) -> Any:
    module, _, function = name.rpartition(".")
    return getattr(importlib.import_module(f"studies.{module}"), function)


def find_benchmark(name: str) -> Benchmark:
    """Return the benchmark of that name.

    Raises:
        DigsError: there is none.
    """
    by_name = {benchmark.name: benchmark for benchmark in BENCHMARKS}
    if name not in by_name:
        raise DigsError(f"studies '{name}': no such benchmark{did_you_mean(name, by_name)}")
    return by_name[name]


BENCHMARKS = (
    # The splat rasterizer: its stages by threads, and their share of what a core can do.
    Benchmark(
        "raster",
        ("raster.bench_raster",),
        ("research/performance.md",),
    ),
    # Each stage of recordings and reconstructions, by frames and by pixels.
    Benchmark(
        "growth",
        ("growth.bench_growth",),
        ("research/performance.md",),
        cases=("frames", "pixels"),
    ),
    # The demo, stage by stage, beside what it took at the commit of the page.
    Benchmark("budget", ("budget.bench_budget",), ("research/performance.md",)),
    # The trained surface against the true one, beside fused depth: three sensors.
    Benchmark(
        "surface",
        ("surface.bench_surface",),
        ("training.md",),
        cases=(
            *("ycb_mustard_bottle", "avocado", "spot"),
            *("ycb_cracker_box", "armchair", "flight_helmet"),
        ),
    ),
    # Meshes at four voxel sizes, files of every format.
    Benchmark("trained", ("trained.bench_trained",), ("results.md", "formats.md")),
    # Real recordings, poses as recorded and estimated: quality, depth error, what goes wrong.
    Benchmark(
        "recordings",
        ("recordings.bench_recordings",),
        ("recordings.md",),
        cases=(
            *("hololens_room_sequence", "tum_cabinet_orbit", "lund_door_photos"),
            "euroc_static_stereo",
        ),
    ),
    # Simulated photographs without their depth, beside the sensor's.
    Benchmark("photographs", ("photographs.bench_photographs",), ("initialization.md",)),
    # The simulated depth sensor: time and scores of every tier.
    Benchmark("sim", ("simulator.bench_sim",), ("research/sensor-cost.md",)),
    # Where the simulated sensor errs, against real matching.
    Benchmark("realism", ("realism.bench_realism",), ("research/sensor-cost.md",)),
    # Figures of real depth cameras beside those of the simulated ones.
    Benchmark("device", ("device.bench_device",), ("research/devices.md", "sensor.md")),
)
