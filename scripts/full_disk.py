"""Run every command that writes on disks that run full at each successive write.

    python scripts/full_disk.py                   # all commands, in some minutes
    python scripts/full_disk.py --case simulate
    python scripts/full_disk.py --page            # all, and the table in docs/stability.md

Each run has to fail with a message that names a file and says what to do, and to leave nothing truncated
under a final name. With room, the same command (with --resume where it has it) has to give the files of a
run that nothing disturbed. Disks are small file systems in memory: the user must be allowed to mount them.
The exit code is 1 if anything goes wrong.
"""

import argparse
import logging
import sys
import tempfile
from pathlib import Path

from full_disks.cases import CASES, find_cases, make_inputs
from full_disks.walk import Walked, walk
from page_marks import fill

from digs_warp.record.progress import progress, show_progress


def table(walked: dict[str, Walked]) -> str:
    """Return the Markdown table of the page."""
    lines = [
        "| command | times the disk ran full | files at which it did | unclear or silent failures, "
        "truncated files, different results |",
        "|---|---|---|---|",
    ]
    lines += [
        f"| {name} | {each.runs} | {len(each.files)} | {len(each.defects)} |"
        for name, each in walked.items()
    ]
    runs, defects = (
        sum(each.runs for each in walked.values()),
        sum(len(each.defects) for each in walked.values()),
    )
    return "\n".join([*lines, f"| all | {runs} | | {defects} |"])


def main() -> int:
    """Walk through the cases; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--case", action="append", default=[], help="a row of the table; several")
    parser.add_argument(
        "--page", action="store_true", help="write the table into docs/stability.md"
    )
    options = parser.parse_args()
    cases = find_cases(options.case)
    if options.page and len(cases) < len(CASES):
        raise SystemExit("--page needs all cases")
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
        _say(str(fill("stability.md", "full disks", text)))
    return int(any(each.defects for each in walked.values()))


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
