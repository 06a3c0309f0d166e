"""`digs-warp bench`: run a benchmark, print its table."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import tyro

from digs_warp.checks import DigsError
from digs_warp.record.files import write_atomically
from digs_warp.study.benchmarks import BENCHMARKS, Benchmark
from digs_warp.study.results import write_json_lines

NAMES = tuple(benchmark.name for benchmark in BENCHMARKS)


@dataclass(frozen=True, kw_only=True)
class Bench:
    """Measure how fast a part is on this machine and print a table."""

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
    """Also write the results to this file: one JSON object per line with name, value, unit, settings."""

    plot: Path | None = None
    """Also draw the results into this PNG file; for benchmarks that have a picture: sim."""

    can_resume: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if self.name not in NAMES:
            raise DigsError(f"bench '{self.name}': no such benchmark; there is: {', '.join(NAMES)}")
        if self.plot is not None and not self._benchmark.plot_function:
            raise DigsError(f"bench '{self.name}': has no picture; leave out --plot")

    def execute(self) -> str:
        """Measure, write the file, return the table."""
        benchmark = self._benchmark
        results = benchmark.run()
        lines = [benchmark.table(results)]
        if self.json is not None:
            write_json_lines(results, self.json)
            lines.append(f"{len(results)} results, also in {self.json}")
        if self.plot is not None:
            write_atomically(self.plot, benchmark.plot(results))
            lines.append(f"drawn in {self.plot}")
        return "\n\n".join(lines)

    @property
    def _benchmark(self) -> Benchmark:
        return next(b for b in BENCHMARKS if b.name == self.name)
