"""Run benchmarks and write their tables and pictures into the documentation, between its marks.

Without names all benchmarks run, which takes an hour and a half on a quiet machine. A long one can be
measured in parts (`digs-warp bench NAME --only CASE --json FILE`), and then be published with --results.
"""

import argparse
import platform
from collections.abc import Sequence
from pathlib import Path

from page_marks import DOCS, fill, marks

from digs_warp.record.files import write_atomically
from digs_warp.record.progress import show_progress
from digs_warp.record.run_log import versions
from digs_warp.study.benchmarks import BENCHMARKS, Benchmark, find_benchmark
from digs_warp.study.charts import side_by_side
from digs_warp.study.machine import processor
from digs_warp.study.results import Result, read_json_lines, tables


def main() -> None:
    """Measure the named benchmarks and publish them, or publish what was measured before."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="BENCHMARK")
    parser.add_argument(
        "--results",
        nargs="+",
        type=Path,
        metavar="FILE",
        help="publish these results of one benchmark, measured on this machine, instead of running it",
    )
    given = parser.parse_args()
    chosen = [find_benchmark(name) for name in given.names] or list(BENCHMARKS)
    if given.results:
        if len(chosen) != 1:
            parser.error("--results belongs to one benchmark; name it")
        parts = [each for path in given.results for each in read_json_lines(path)]
        publish(chosen[0], chosen[0].joined(parts))
        return
    show_progress()
    for benchmark in chosen:
        publish(benchmark, benchmark.run())


def publish(benchmark: Benchmark, results: Sequence[Result]) -> None:
    """Write what a benchmark measured into its page; a page shows the tables that it has marks for.

    The mark of a table is the name of the benchmark, followed by that of the table where it has one.
    """
    if charts := benchmark.charts(results):
        write_atomically(DOCS / "images" / f"{benchmark.name}.png", side_by_side(charts))
    texts = {f"{benchmark.name} {t.name}".strip(): t.markdown() for t in tables(results)}
    found = versions()
    texts["machine"] = (
        f"Measured on {processor()}, {platform.system()}, Python {found['python']}, "
        f"Warp {found['warp-lang']}."
    )
    for mark in marks(benchmark.page):
        if mark in texts:
            fill(benchmark.page, mark, texts[mark])


if __name__ == "__main__":
    main()
