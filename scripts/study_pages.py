"""Publish the results of the studies in out/study in docs/study: records, tables, plots, pages.

Usage: python scripts/study_pages.py [NAME ...]   (default: all that have results; takes seconds)
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from digs_warp.engines.task import RESULTS
from digs_warp.record.files import write_atomically
from digs_warp.study.catalogue import STUDIES, Study, find_study
from digs_warp.study.engine.case import with_file_names
from digs_warp.study.engine.store import Store
from digs_warp.study.page import MARKDOWN, PAGE

TARGET = Path(__file__).resolve().parent.parent / "docs" / "study"

INDEX = """# Studies

What accuracy costs in time. `make studies` runs `digs-warp study run NAME --time-budget TIME` for each study
and writes these pages. Beside each page, `results.jsonl` has every case with its settings, versions, machine,
times, memory and quality, and `tables/` has the tables as CSV. On your own machine:

```sh
digs-warp study list
digs-warp study run tradeoff --time-budget 20min
digs-warp study report tradeoff
```

A study that was interrupted, or has used up its budget, goes on where it stopped.

| study | what it asks | cases |
|---|---|---|
{rows}
"""


def main(names: Sequence[str]) -> None:
    """Publish the named studies, then write the index of all that are published."""
    for study in [find_study(name) for name in names] or STUDIES:
        if (study.folder / RESULTS).is_file():
            publish(study, TARGET / study.name)
    write_index()


def publish(study: Study, folder: Path) -> None:
    """Write results, report, tables and plots of a study into ``folder``."""
    lines = [json.dumps(portable(record)) for record in Store(study.folder).records.values()]
    write_atomically(folder / RESULTS, ("\n".join(lines) + "\n").encode())
    study.report(folder)
    # The documentation shows the Markdown page; the HTML page would repeat its pictures.
    (folder / PAGE).unlink()


def portable(record: dict[str, Any]) -> dict[str, Any]:
    """Return the record with the names of input files and of the recording instead of where they lay."""
    results = record.get("results", {})
    if "capture" in results:
        results = results | {"capture": Path(results["capture"]).name}
    return record | {"recording": with_file_names(record["recording"]), "results": results}


def write_index() -> None:
    """Write index.md."""
    rows = []
    for study in STUDIES:
        folder = TARGET / study.name
        if (folder / RESULTS).is_file():
            count = len(Store(folder).records)
            link = f"[{study.title}]({study.name}/{MARKDOWN})"
            rows.append(f"| {link} | {study.summary} | {count} |")
    write_atomically(TARGET / "index.md", INDEX.format(rows="\n".join(rows)).encode())


if __name__ == "__main__":
    main(sys.argv[1:])
