"""Damage inputs of every kind and see whether each is read, or refused with a message.

    python scripts/fuzz.py --count 100                       # 100 inputs of each kind
    python scripts/fuzz.py --count 556 --page  # 10,000, and the totals in docs/research/stability.md

A traceback, a crash, more than 1 GB beyond the start and more than 10 s of the processor are defects; their
inputs are kept with the command lines that read them. The exit code is 1 if there are any.
"""

import argparse
import datetime
import logging
import math
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

from fuzzing.inputs import Inputs, Kind
from fuzzing.kinds import find_kinds
from fuzzing.originals import Originals
from fuzzing.worker import Outcome, Worker
from page_marks import fill

from digs_warp.record.progress import progress, show_progress
from digs_warp.record.run_log import versions
from digs_warp.study.table import Table

PAGE = "research/stability.md"
PACKAGES = ("numpy", "trimesh", "usd-core", "OpenImageIO")  # that read files
HEADINGS = (
    *("kind", "inputs", "read", "refused", "tracebacks", "crashes"),
    *("above 1 GB", "above 10 s", "most memory [MB]", "longest [s]"),
)

# The outcomes of each kind of input.
Tallies = dict[str, list[Outcome]]


def fuzz(
    kinds: tuple[Kind, ...], count: int, seed: int, keep: Path, minutes: float = math.inf
) -> Tallies:
    """Run ``count`` damaged inputs of each kind; write those that show a defect into ``keep``.

    After ``minutes`` no more are begun; the kinds take turns, so there are about as many of each.
    """
    tallies: Tallies = {kind.name: [] for kind in kinds}
    by_name, end = {kind.name: kind for kind in kinds}, time.monotonic() + 60 * minutes
    with (
        tempfile.TemporaryDirectory(prefix="fuzz-") as name,
        progress(count * len(kinds), "Fuzzing", "input") as bar,
    ):
        inputs = Inputs(Originals(Path(name) / "originals"), Path(name), seed)
        inputs.originals.folder.mkdir()
        for folder in dict.fromkeys(each.folder for kind in kinds for each in kind.inputs):
            inputs.originals.make(folder)
        worker = Worker(lambda name: inputs.healthy(by_name[name]))
        for number, kind in product(range(count), kinds):
            if time.monotonic() > end:
                break
            written = inputs.write(kind, number)
            outcome = worker.run(written)
            inputs.remove(written)
            tallies[kind.name].append(outcome)
            if outcome.is_defect:
                last = (outcome.detail.strip().splitlines() or [""])[-1][:300]
                _say(f"{outcome.end}: {inputs.keep(kind, number, outcome, keep)}: {last}")
            bar.update()
        worker.stop()
    return tallies


def table(tallies: Mapping[str, Sequence[Outcome]]) -> Table:
    """Return one row per kind, and their sum."""
    everything = [outcome for outcomes in tallies.values() for outcome in outcomes]
    rows = [_row(*each) for each in [*tallies.items(), ("all", everything)]]
    return Table("", list(HEADINGS), rows)


def _row(name: str, outcomes: Sequence[Outcome]) -> list[str]:
    ends = [outcome.end for outcome in outcomes]
    counts = [ends.count(e) for e in ("read", "refused", "traceback", "crash", "memory", "time")]
    worst = max((outcome.megabytes for outcome in outcomes), default=0.0)
    longest = max((outcome.seconds for outcome in outcomes), default=0.0)
    shown = [f"{count:,}" for count in (len(ends), *counts)]
    return [name, *shown, f"{worst:.0f}", f"{longest:.1f}"]


def publish(tallies: Tallies, count: int, seed: int) -> None:
    """Write the totals into the page."""
    found = versions()
    packages = ", ".join(f"{name} {found[name]}" for name in ("digs-warp", *PACKAGES))
    head = (
        f"`python scripts/fuzz.py --count {count} --seed {seed} --page` on {datetime.date.today()}: "
        f"Python {found['python']}, {packages}. Memory is what a process takes beyond what it had before the "
        "input, time is that of the processor."
    )
    counted = table(tallies)
    totals = replace(counted, rows=counted.rows[-1:])
    fill(PAGE, "fuzz", f"{head}\n\n{totals.markdown()}")


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main() -> int:
    """Read the command line and run it; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    add = parser.add_argument
    add("--kind", action="append", default=[], help="part of a kind's name; may be repeated")
    add("--count", type=int, default=20, help="inputs of each kind")
    add("--minutes", type=float, default=math.inf, help="begin no input later")
    add("--seed", type=int, default=0)
    add("--keep", type=Path, default=Path("out/fuzz"), help="folder for inputs with defects")
    add("--page", action="store_true", help=f"write the totals into docs/{PAGE}")
    given = parser.parse_args()
    # A bar on a terminal, a line every half minute in a log.
    show_progress()
    logging.basicConfig(level=logging.ERROR, format="%(message)s")
    logging.getLogger("digs_warp.record.progress").setLevel(logging.INFO)
    kinds, keep = find_kinds(given.kind), given.keep.resolve()
    tallies = fuzz(kinds, given.count, given.seed, keep, given.minutes)
    _say(table(tallies).markdown())
    if given.page:
        publish(tallies, given.count, given.seed)
    return int(any(outcome.is_defect for outcomes in tallies.values() for outcome in outcomes))


if __name__ == "__main__":
    sys.exit(main())
