"""Damage inputs of every kind and see whether each is read, or refused with a message.

    python scripts/fuzz.py --count 100                       # 100 inputs of each kind
    python scripts/fuzz.py --kind "splats: PLY" --count 1000
    python scripts/fuzz.py --again out/fuzz/splats-ply-0-17  # a kept input once more
    python scripts/fuzz.py --count 556 --page  # 10,000, and the table in docs/research/stability.md

A traceback, a crash, more than 1 GB beyond the start and more than 10 s of the processor are defects; their
inputs are kept with the command lines that read them. The exit code is 1 if there are any.
"""

import argparse
import datetime
import logging
import math
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from fuzzing.inputs import Inputs, kept_job
from fuzzing.kinds import Kind, find_kinds
from fuzzing.originals import Originals
from fuzzing.pool import Worker
from fuzzing.tally import Tally, table
from fuzzing.worker import Outcome
from page_marks import fill

from digs_warp.record.progress import progress, show_progress
from digs_warp.record.run_log import versions

PACKAGES = ("numpy", "trimesh", "usd-core", "OpenImageIO")  # that read files


def fuzz(
    kinds: tuple[Kind, ...],
    count: int,
    seed: int,
    keep: Path,
    workers: int = 1,
    minutes: float = math.inf,
) -> dict[str, Tally]:
    """Run ``count`` damaged inputs of each kind; write those that show a defect into ``keep``.

    After ``minutes`` no more are begun; the kinds take turns, so there are about as many of each.
    """
    tallies = {kind.name: Tally() for kind in kinds}
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
        inputs = Inputs(Originals(Path(name) / "originals"), Path(name), seed)
        inputs.originals.folder.mkdir()
        for kind in kinds:
            kind.prepare(inputs.originals)
        pool = _Pool(inputs, {kind.name: kind for kind in kinds}, 60 * minutes)
        jobs = [(kind, number) for number in range(count) for kind in kinds]
        with progress(len(jobs), "Fuzzing", "input") as bar, ThreadPoolExecutor(workers) as threads:
            for (kind, number), outcome in zip(jobs, threads.map(pool.run, jobs), strict=True):
                if outcome is None:
                    continue
                tallies[kind.name].outcomes.append(outcome)
                if outcome.is_defect:
                    _say(
                        f"{outcome.end}: {inputs.keep(kind, number, outcome, keep)}: {_last_line(outcome)}"
                    )
                bar.update()
        pool.stop()
    return tallies


class _Pool:
    """One `Worker` per thread; it begins no input after some seconds."""

    def __init__(self, inputs: Inputs, kinds: dict[str, Kind], seconds: float) -> None:
        self._inputs, self._kinds = inputs, kinds
        self._end = time.monotonic() + seconds
        self._workers: dict[int, Worker] = {}

    def run(self, job: tuple[Kind, int]) -> Outcome | None:
        if time.monotonic() > self._end:
            return None
        thread = threading.get_ident()
        worker = self._workers.setdefault(
            thread, Worker(lambda name: self._inputs.healthy(self._kinds[name]))
        )
        written = self._inputs.write(*job)
        outcome = worker.run(written)
        self._inputs.remove(written)
        return outcome

    def stop(self) -> None:
        for worker in self._workers.values():
            worker.stop()


def again(folder: Path) -> Outcome:
    """Run a kept input once more."""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as copy:
        worker = Worker(lambda _: [])
        outcome = worker.run(kept_job(folder, Path(copy) / "input"))
        worker.stop()
    return outcome


def publish(tallies: dict[str, Tally], count: int, seed: int) -> None:
    """Write the table into docs/research/stability.md."""
    found = versions()
    packages = ", ".join(f"{name} {found[name]}" for name in ("digs-warp", *PACKAGES))
    head = (
        f"`python scripts/fuzz.py --count {count} --seed {seed} --page` on {datetime.date.today()}: "
        f"Python {found['python']}, {packages}. Memory is what a process takes beyond what it had before the "
        "input, time is that of the processor."
    )
    fill("research/stability.md", "fuzz", f"{head}\n\n{table(tallies).markdown()}")


def _last_line(outcome: Outcome) -> str:
    return (outcome.detail.strip().splitlines() or [""])[-1][:300]


def _log_progress() -> None:
    """Show a bar on a terminal, and a line every half minute in a log."""
    show_progress()
    logging.basicConfig(level=logging.ERROR, format="%(message)s")
    logging.getLogger("digs_warp.record.progress").setLevel(logging.INFO)


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main() -> int:
    """Read the command line and run it; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--kind", action="append", default=[], help="part of a kind's name; may be repeated"
    )
    parser.add_argument("--count", type=int, default=20, help="inputs of each kind")
    parser.add_argument("--minutes", type=float, default=math.inf, help="begin no input later")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=1, help="inputs at the same time")
    parser.add_argument(
        "--keep", type=Path, default=Path("out/fuzz"), help="folder for inputs with defects"
    )
    parser.add_argument("--again", type=Path, help="run one kept input once more")
    parser.add_argument(
        "--page", action="store_true", help="write the table into docs/research/stability.md"
    )
    options = parser.parse_args()
    if options.again:
        outcome = again(options.again)
        _say(
            f"{outcome.detail}\n{outcome.end}, {outcome.seconds:.1f} s, {outcome.megabytes:.0f} MB"
        )
        return int(outcome.is_defect)
    _log_progress()
    tallies = fuzz(
        find_kinds(options.kind),
        options.count,
        options.seed,
        options.keep.resolve(),
        options.workers,
        options.minutes,
    )
    _say(table(tallies).markdown())
    if options.page:
        publish(tallies, options.count, options.seed)
    return int(any(outcome.is_defect for tally in tallies.values() for outcome in tally.outcomes))


if __name__ == "__main__":
    sys.exit(main())
