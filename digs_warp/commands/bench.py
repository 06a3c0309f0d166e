"""`digs-warp bench`: run a benchmark, print its tables."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import tyro

from digs_warp.checks import DigsError
from digs_warp.record.files import write_atomically
from digs_warp.study.benchmarks import BENCHMARKS, find_benchmark


@dataclass(frozen=True, kw_only=True)
class Bench:
    """Measure a part of the package on this machine and print the results as tables."""

    name: Annotated[
        str,
        tyro.conf.Positional,
        tyro.conf.arg(
            metavar="NAME",
            help="What to measure. "
            + "; ".join(f"{b.name}: {b.summary}" for b in BENCHMARKS)
            + ".",
        ),
    ]
    json: Path | None = None
    """Also write the results to this file: one JSON object per case and line with labels and values."""

    plot: Path | None = None
    """Also draw the results into this PNG file; for scaling, convergence and sim."""

    can_resume: ClassVar[bool] = False

    def __post_init__(self) -> None:
        benchmark = find_benchmark(self.name)
        if self.plot is not None and not benchmark.chart_function:
            raise DigsError(f"bench '{self.name}': has no picture; leave out --plot")

    def execute(self) -> str:
        """Measure, write the files, return the tables."""
        from digs_warp.study.charts import side_by_side
        from digs_warp.study.results import format_tables, write_json_lines

        benchmark = find_benchmark(self.name)
        results = benchmark.run()
        parts = [format_tables(results)]
        if self.json is not None:
            write_json_lines(results, self.json)
            parts.append(f"{len(results)} results, also in {self.json}")
        if self.plot is not None:
            write_atomically(self.plot, side_by_side(benchmark.charts(results)))
            parts.append(f"drawn in {self.plot}")
        return "\n\n".join(parts)
