"""Measure the initialization and put the tables into docs/initialization.md.

Usage: python scripts/initialization_page.py [init] [init-noise]   (default: both; keep the machine quiet)
"""

import sys
from collections.abc import Sequence

from page_marks import fill

from digs_warp.record.progress import show_progress
from digs_warp.study.benchmarks import BENCHMARKS
from digs_warp.study.results import Result, format_number

PAGE = "initialization.md"

KINDS = {"points": ",.0f", "mm": ".2f", "share": ".4f", "dB": ".2f", "s": ".2f", "GB": ".2f"}


def main(names: Sequence[str]) -> None:
    """Measure the named benchmarks and rewrite their tables."""
    show_progress()
    tables = {"init": stage_table, "init-noise": wide_table}
    for benchmark in BENCHMARKS:
        if benchmark.name in tables and (not names or benchmark.name in names):
            fill(PAGE, benchmark.name, tables[benchmark.name](benchmark.run()))


def stage_table(results: list[Result]) -> str:
    """Return what was measured, and on what."""
    shared = results[0].settings
    settings = f"{shared['frames']} frames of {shared['size']} depth on {shared['threads']} threads"
    return f"{settings}\n\n{by_strategy(results)}"


def by_strategy(results: list[Result]) -> str:
    """Return a Markdown table: what was measured down, strategies across; then what is no strategy's."""
    strategies = [s for s in dict.fromkeys(r.settings.get("strategy", "") for r in results) if s]
    cells = {(r.name, r.settings.get("strategy", "")): cell(r) for r in results}
    names = list(dict.fromkeys(r.name for r in results))
    lines = ["| | " + " | ".join(strategies) + " |", "|---|" + "---|" * len(strategies)]
    for name in names:
        row = [cells.get((name, strategy), "") for strategy in strategies]
        if any(row):
            lines.append(f"| {name} | " + " | ".join(row) + " |")
    return "\n".join(lines)


def wide_table(results: list[Result]) -> str:
    """Return a Markdown table: settings down, names across."""
    keys, names = list(results[0].settings), list(dict.fromkeys(r.name for r in results))
    rows: dict[tuple[str, ...], dict[str, str]] = {}
    for r in results:
        rows.setdefault(tuple(map(str, r.settings.values())), {})[r.name] = number(r)
    lines = ["| " + " | ".join([*keys, *names]) + " |", "|" + "---|" * (len(keys) + len(names))]
    for settings, values in rows.items():
        lines.append("| " + " | ".join([*settings, *(values.get(n, "") for n in names)]) + " |")
    return "\n".join(lines)


def number(result: Result) -> str:
    """Return the value with the digits of its unit."""
    return (
        format(result.value, KINDS[result.unit])
        if result.unit in KINDS
        else format_number(result.value)
    )


def cell(result: Result) -> str:
    """Return value and unit; of counts and shares the value alone."""
    return (
        number(result) if result.unit in ("points", "share") else f"{number(result)} {result.unit}"
    )


if __name__ == "__main__":
    main(sys.argv[1:])
