"""Write what changed between two results of a study into docs/studies.md, for the cases that both have.

Usage: python scripts/study_change.py NAME BEFORE [NOW [WORDS]]

BEFORE and NOW are files of results; NOW is by default the published one, docs/study/NAME/results.jsonl.
WORDS keep only the cases that have them in their name, as it is shown in the table.
Git has the older ones: git show COMMIT:docs/study/NAME/results.jsonl > before.jsonl
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from page_marks import DOCS, fill

from digs_warp.engines.results import RESULTS
from digs_warp.measure.scores import named_now

PAGE = "studies.md"


def main(arguments: Sequence[str]) -> None:
    """Fill the mark ``change NAME``.

    Raises:
        SystemExit: wrong arguments.
    """
    if len(arguments) not in (2, 3, 4):
        sys.exit(__doc__)
    name, before = arguments[0], Path(arguments[1])
    now = Path(arguments[2]) if len(arguments) > 2 else DOCS / "study" / name / RESULTS
    words = arguments[3] if len(arguments) == 4 else ""
    chosen = {case: record for case, record in cases_of(now).items() if words in case}
    fill(PAGE, f"change {name}", change_table(cases_of(before), chosen))


def cases_of(path: Path) -> dict[str, dict[str, Any]]:
    """Return the records of a file of results by what tells their cases apart."""
    records = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return {case_of(record): record for record in records}


def case_of(record: dict[str, Any]) -> str:
    """Return the labels of a record in words."""
    words = [f"{value:g}" if isinstance(value, float) else f"{value}" for value in _labels(record)]
    return ", ".join(words)


def _labels(record: dict[str, Any]) -> list[Any]:
    """Return the values of the labels; numbers say what they count; the first seed is left out."""
    named = {"iterations": "{} steps", "strength": "strength {:g}", "seed": "seed {}"}
    labels = {
        name: value for name, value in record["labels"].items() if (name, value) != ("seed", 0)
    }
    return [named[name].format(value) if name in named else value for name, value in labels.items()]


def change_table(before: dict[str, dict[str, Any]], now: dict[str, dict[str, Any]]) -> str:
    """Return a table of the cases that are in both, in the order of ``now``.

    Raises:
        ValueError: there is none.
    """
    shared = [case for case in now if case in before]
    if not shared:
        raise ValueError("no case is in both files; expected results of the same study")
    lines = [
        "| | PSNR on the object before [dB] | now | error of the scale before | now |",
        "|---|--:|--:|--:|--:|",
    ]
    for case in sorted(shared):
        old, new = before[case], now[case]
        psnr = (f"{named_now(record['metrics'])['psnr_object']:.2f}" for record in (old, new))
        scale = (_percent(record.get("scale_error")) for record in (old, new))
        lines.append("| " + " | ".join((case, *psnr, *scale)) + " |")
    return "\n".join(lines)


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100 * abs(share):.2f} %"


if __name__ == "__main__":
    main(sys.argv[1:])
