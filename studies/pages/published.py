"""Publishes the results of the studies in out/study in docs/study: records, tables, plots, reports."""

import csv
import json
from pathlib import Path
from typing import Any

from digs_warp.engines.task import RESULTS
from digs_warp.record.files import write_atomically
from digs_warp.study.catalogue import STUDIES, Study
from digs_warp.study.engine.case import with_file_names
from digs_warp.study.engine.store import Store
from digs_warp.study.page import MARKDOWN, PAGE
from digs_warp.study.table import Table
from scripts.page_marks import DOCS

# Rows; longer tables stand in their files alone.
LONGEST_TABLE = 10


def main() -> None:
    """Publish all that have results."""
    for study in STUDIES:
        if (study.folder / RESULTS).is_file():
            publish(study, DOCS / "study" / study.name)


def publish(study: Study, folder: Path) -> None:
    """Write results, report, tables and plots of a study into ``folder``."""
    lines = [json.dumps(portable(record)) for record in Store(study.folder).records.values()]
    write_atomically(folder / RESULTS, ("\n".join(lines) + "\n").encode())
    study.report(folder)
    # The documentation shows the Markdown page; the HTML page would repeat its pictures.
    (folder / PAGE).unlink()
    shorten(folder)


def shorten(folder: Path) -> None:
    """Replace long tables in the Markdown page by links to their files."""
    page = folder / MARKDOWN
    text = page.read_text(encoding="utf-8")
    for path in sorted((folder / "tables").glob("*.csv")):
        headings, *rows = csv.reader(path.read_text(encoding="utf-8").splitlines())
        if len(rows) > LONGEST_TABLE:
            table = Table(path.stem, headings, rows).markdown()
            link = f"[{len(rows)} rows](tables/{path.name})"
            text = text.replace(table.strip(), link)
    write_atomically(page, text.encode())


def portable(record: dict[str, Any]) -> dict[str, Any]:
    """Return the record with the names of input files instead of where they lay."""
    return record | {"recording": with_file_names(record["recording"])}
