"""`digs-warp bench NAME`: run a benchmark, print its tables."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from digs_warp.commands.command import Command, Group, Preset
from digs_warp.commands.output import check_output_file
from digs_warp.record.files import write_atomically
from digs_warp.study.benchmarks import BENCHMARKS, Benchmark, find_benchmark
from digs_warp.words import counted

if TYPE_CHECKING:
    from digs_warp.study.results import Result


@dataclass(frozen=True, kw_only=True)
class Bench(Command):
    """Run a benchmark and print its tables."""

    name: Annotated[str, tyro.conf.Suppress]

    json: Path | None = None
    """Also write the results to this file: one JSON object per case and line with labels and values."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace files that exist."""

    def execute(self) -> str:
        """Measure, write the files, return the tables."""
        from digs_warp.study.results import format_tables, write_json_lines

        for flag, path in self._files().items():
            check_output_file(path, self.overwrite, flag=flag)
        results = self._measure()
        parts = [format_tables(results)]
        if self.json is not None:
            write_json_lines(results, self.json)
            parts.append(f"{counted(len(results), 'result')}, also in {self.json}")
        return "\n\n".join([*parts, *self._draw(results)])

    def _measure(self) -> "list[Result]":
        return find_benchmark(self.name).run()

    def _files(self) -> dict[str, Path]:
        """Return the files to write, by flag."""
        return {"--json": self.json} if self.json else {}

    def _draw(self, results: "Sequence[Result]") -> list[str]:
        return []


@dataclass(frozen=True, kw_only=True)
class BenchWithPicture(Bench):
    """Run a benchmark whose results can be drawn."""

    plot: Path | None = None
    """Also draw the results into this PNG file."""

    def _files(self) -> dict[str, Path]:
        return super()._files() | ({"--plot": self.plot} if self.plot else {})

    def _draw(self, results: "Sequence[Result]") -> list[str]:
        from digs_warp.study.charts import side_by_side

        if self.plot is None:
            return []
        write_atomically(self.plot, side_by_side(find_benchmark(self.name).charts(results)))
        return [f"drawn in {self.plot}"]


@dataclass(frozen=True, kw_only=True)
class BenchOfCases(Bench):
    """Run a benchmark, or some of its cases."""

    only: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME [NAME ...]")] = ()
    """Measure only these. Default: all that are there."""

    def _measure(self) -> "list[Result]":
        return find_benchmark(self.name).run(self.only)


def _preset(benchmark: Benchmark) -> Preset:
    kind = _kind(benchmark)
    measured = benchmark.summary[0].upper() + benchmark.summary[1:]
    about = f"{measured}.\n\nMeasures this and prints the results as tables."
    if benchmark.cases:
        about += f" --only takes some of {', '.join(benchmark.cases)}."
    return Preset(kind(name=benchmark.name), about)


def _kind(benchmark: Benchmark) -> type[Bench]:
    if benchmark.cases:
        return BenchOfCases
    return BenchWithPicture if benchmark.chart_function else Bench


BENCH = Group(
    "Measure how fast a part of the package is on this machine.",
    {benchmark.name: _preset(benchmark) for benchmark in BENCHMARKS},
)
