"""Run benchmarks and write their tables and pictures into the documentation, between its marks.

Usage: python scripts/pages.py [BENCHMARK ...]

Without names all benchmarks run, which takes an hour and a half on a quiet machine.
"""

import platform
import sys
from collections.abc import Sequence

from page_marks import DOCS, fill, marks

from digs_warp.record.files import write_atomically
from digs_warp.record.progress import show_progress
from digs_warp.record.run_log import versions
from digs_warp.study.benchmarks import BENCHMARKS, Benchmark, find_benchmark
from digs_warp.study.charts import side_by_side
from digs_warp.study.machine import processor
from digs_warp.study.results import Result, tables


def main(names: Sequence[str]) -> None:
    """Measure the named benchmarks and publish them."""
    show_progress()
    for benchmark in [find_benchmark(name) for name in names] or BENCHMARKS:
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
    main(sys.argv[1:])
