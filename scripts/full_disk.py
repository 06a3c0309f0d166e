"""Run every command that writes on disks that run full at each successive write.

    python scripts/full_disk.py                   # all commands, in some minutes
    python scripts/full_disk.py --case simulate
    python scripts/full_disk.py --page            # all, and their rows in docs/research/stability.md

Each run has to fail with a message that names a file and says what to do, and to leave nothing truncated
under a final name. With room, the same command (with --resume where it has it) has to give the files of a
run that nothing disturbed. Disks are small file systems in memory: the user must be allowed to mount them.
The exit code is 1 if anything goes wrong.
"""

import argparse
import logging
import re
import sys
import tempfile
from pathlib import Path

from full_disks.cases import CASES, find_cases, make_inputs
from full_disks.walk import Walked, walk
from page_marks import DOCS, fill

from digs_warp.record.progress import progress, show_progress

PAGE = "research/stability.md"


def table(walked: dict[str, Walked], before: str = "") -> str:
    """Return the Markdown table of the page; rows of other commands are taken from ``before``."""
    rows = dict(re.findall(r"^\| (.+?) \| (\d+ \| \d+ \| \d+) \|$", before, re.MULTILINE))
    rows |= {
        name: f"{each.runs} | {len(each.files)} | {len(each.defects)}"
        for name, each in walked.items()
    }
    lines = [f"| {case.name} | {rows[case.name]} |" for case in CASES if case.name in rows]
    numbers = [row.split(" | ") for row in rows.values()]
    runs, defects = sum(int(row[0]) for row in numbers), sum(int(row[2]) for row in numbers)
    head = (
        "| command | times the disk ran full | files at which it did | unclear or silent failures, "
        "truncated files, different results |\n|---|---|---|---|"
    )
    return "\n".join([head, *lines, f"| all | {runs} | | {defects} |"])


def main() -> int:
    """Walk through the cases; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--case", action="append", default=[], help="a row of the table; several")
    parser.add_argument(
        "--page", action="store_true", help="write their rows into docs/research/stability.md"
    )
    options = parser.parse_args()
    cases = find_cases(options.case)
    logging.disable(logging.WARNING)
    walked: dict[str, Walked] = {}
    with tempfile.TemporaryDirectory(prefix="full-disk-") as name:
        inputs = make_inputs(Path(name) / "in", cases)
        show_progress()
        with progress(len(cases), "Running disks full", "command") as bar:
            for case in cases:
                walked[case.name] = walk(case, inputs, Path(name) / "out")
                bar.update()
                for defect in walked[case.name].defects:
                    _say(defect)
    text = table(walked)
    _say(text)
    if options.page:
        before = (DOCS / PAGE).read_text(encoding="utf-8")
        _say(str(fill(PAGE, "full disks", table(walked, before))))
    return int(any(each.defects for each in walked.values()))


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
