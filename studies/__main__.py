"""Measure the project, and write what was found into its documentation.

python -m studies NAME [--only CASE ...] [--json FILE]   run a benchmark, print its tables
python -m studies page NAME                              write figures or pictures into the documentation
python -m studies preference make|evaluate ...           ask people which reconstruction they prefer
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.record.progress import show_progress
from studies import pages
from studies.benchmarks import BENCHMARKS, find_benchmark
from studies.results import format_tables, write_json_lines


def main(words: Sequence[str]) -> None:
    """Run one command."""
    show_progress()
    command, *rest = words or ("--help",)
    if command == "page":
        _write_page(rest)
    elif command == "preference":
        from studies.preference import main as preference

        preference(rest)
    else:
        _measure(words)


def _measure(words: Sequence[str]) -> None:
    parser = argparse.ArgumentParser(
        prog="python -m studies",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("name", choices=[benchmark.name for benchmark in BENCHMARKS])
    parser.add_argument("--only", nargs="+", default=(), metavar="CASE")
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="one JSON object per case and line"
    )
    given = parser.parse_args(words)
    results = find_benchmark(given.name).run(given.only)
    if given.json:
        write_json_lines(results, given.json)
    sys.stdout.write(f"{format_tables(results)}\n")


def _write_page(words: Sequence[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m studies page")
    names = [*(each.name for each in BENCHMARKS if each.pages), *pages.PAGES]
    parser.add_argument("names", nargs="+", choices=names, metavar="NAME", help=", ".join(names))
    given = parser.parse_args(words)
    for name in given.names:
        if name in pages.PAGES:
            pages.write(name)
            continue
        benchmark = find_benchmark(name)
        pages.publish(benchmark, benchmark.run())


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except DigsError as error:
        sys.exit(f"studies: {error}")
