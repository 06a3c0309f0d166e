"""Measure structure from motion, masks and long runs, and put the tables into their pages under docs.

Usage: python scripts/front_end_figures.py [masks] [sfm] [sfm-full] [sfm-sensor] [paper-length]

Without names all are measured.
"""

import sys
from collections.abc import Sequence

from page_marks import fill

from digs_warp.record.progress import show_progress
from digs_warp.study.benchmarks import BENCHMARKS
from digs_warp.study.results import Result, format_number

PAGES = {
    **{"masks": "masks.md", "sfm": "sfm.md", "sfm-full": "sfm.md", "sfm-sensor": "sfm.md"},
    "paper-length": "studies.md",
}


def main(names: Sequence[str]) -> None:
    """Measure the named benchmarks and rewrite their tables."""
    show_progress()
    for benchmark in BENCHMARKS:
        if benchmark.name in PAGES and (not names or benchmark.name in names):
            fill(PAGES[benchmark.name], benchmark.name, markdown(benchmark.run()))


def markdown(results: Sequence[Result]) -> str:
    """Return one row per case and one column per number; what all cases share stands above."""
    rows: dict[str, list[Result]] = {}
    for result in results:
        rows.setdefault(str(next(iter(result.settings.values()))), []).append(result)
    columns = list(dict.fromkeys((r.name, r.unit) for r in results))
    shared = list(results[0].settings.items())[1:]
    lines = [
        ", ".join(f"{key}: {value}" for key, value in shared),
        "",
        "| | " + " | ".join(f"{name} [{unit}]" if unit else name for name, unit in columns) + " |",
        "|---|" + "---|" * len(columns),
    ]
    for case, numbers in rows.items():
        found = {(r.name, r.unit): format_number(r.value) for r in numbers}
        lines.append(f"| {case} | " + " | ".join(found.get(c, "") for c in columns) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    main(sys.argv[1:])
