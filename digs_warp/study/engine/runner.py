"""Runs the cases of a study on an engine: resumable, within a time budget."""

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from digs_warp.engines.config import EngineConfig
from digs_warp.engines.run import Outcome, check_keys, run_tasks
from digs_warp.engines.start import needs_of, started
from digs_warp.engines.task import Task
from digs_warp.record.files import plain
from digs_warp.record.lock import sole_writer
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.store import Store

Measure = Callable[[Case, Path], dict[str, Any]]


def run_cases(
    cases: Sequence[Case],
    folder: Path,
    *,
    measure: Measure,
    engine: EngineConfig | None = None,
    budget: float | None = None,
) -> Outcome:
    """Measure every case without a result in ``folder``, in order, each in its own process.

    A failed case is recorded with its error, does not stop the others, and runs again next time.

    Args:
        cases: the most important first.
        folder: of the study; results are added to its results.jsonl.
        measure: the function for a case, at module level because another process calls it.
        engine: where the cases run; None: one at a time on this machine. Cases at the same time share the
            cores, so their seconds are only comparable with one worker.
        budget: seconds; no case is begun that would probably end later. None: no limit.

    Raises:
        DigsError: two cases with the same key, or a folder that another run is measuring into.
    """
    folder = Path(folder).resolve()  # of the workers, too
    config = engine or EngineConfig()
    needs = replace(needs_of(config), alone=True)
    tasks = []
    for case in cases:
        facts = {part.name: plain(getattr(case, part.name)) for part in fields(case)}
        name = " ".join(f"{key}={value}" for key, value in case.labels.items())
        facts["threads"] = needs.threads
        tasks.append(Task(case.key, name, measure, (case, folder), needs, facts))
    check_keys(tasks, "study: two cases have the same labels and settings; make the labels differ")
    with sole_writer(folder), started(config, folder) as workers:
        return run_tasks(tasks, Store(folder), folder, workers, budget=budget)
