"""`digs-warp bench`: run a benchmark, print its table."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import tyro

from digs_warp.checks import DigsError
from digs_warp.study.benchmarks import BENCHMARKS
from digs_warp.study.results import format_table, write_json_lines

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

    can_resume: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if self.name not in NAMES:
            raise DigsError(f"bench '{self.name}': no such benchmark; there is: {', '.join(NAMES)}")

    def execute(self) -> str:
        """Measure, write the file, return the table."""
        results = next(b for b in BENCHMARKS if b.name == self.name).run()
        table = format_table(results)
        if self.json is None:
            return table
        write_json_lines(results, self.json)
        return f"{table}\n\n{len(results)} results, also in {self.json}"
