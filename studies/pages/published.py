"""Publishes the results of the studies in out/study in docs/study: records, tables, plots, reports."""

import json
from pathlib import Path
from typing import Any

from digs_warp.engines.task import RESULTS
from digs_warp.record.files import write_atomically
from digs_warp.study.catalogue import STUDIES, Study
from digs_warp.study.engine.case import with_file_names
from digs_warp.study.engine.store import Store
from digs_warp.study.page import PAGE
from scripts.page_marks import DOCS
from studies.catalogue import MORE_STUDIES


def main() -> None:
    """Publish all that have results."""
    for study in (*STUDIES, *MORE_STUDIES):
        if (study.folder / RESULTS).is_file():
            publish(study, DOCS / "study" / study.name)


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
