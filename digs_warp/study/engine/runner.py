"""Runs the cases of a study: resumable, in worker processes, within a time budget."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import wait
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.device.parallel import default_threads
from digs_warp.record.interruption import deferred_interrupt
from digs_warp.record.lock import sole_writer
from digs_warp.record.progress import progress
from digs_warp.study.engine.case import Case, plain
from digs_warp.study.engine.store import Store
from digs_warp.study.engine.worker import Measure, Worker
from digs_warp.words import counted


@dataclass(frozen=True)
class Outcome:
    """The outcome of a run of a study: numbers of cases."""

    done_before: int
    done: int
    failed: int
    left_out: int

    def __str__(self) -> str:
        words = [f"{counted(self.done, 'case')} measured"]
        if self.done_before:
            words.append(f"{self.done_before} were there before")
        if self.failed:
            words.append(f"{self.failed} failed")
        if self.left_out:
            words.append(f"{self.left_out} left out by the time budget")
        return ", ".join(words)


def run_cases(
    cases: Sequence[Case],
    folder: Path,
    *,
    measure: Measure,
    workers: int = 1,
    budget: float | None = None,
) -> Outcome:
    """Measure every case without a result in ``folder``, in order, each in its own process.

    A failed case is recorded with its error, does not stop the others, and runs again next time.

    Args:
        cases: the most important first.
        folder: of the study; results are added to its results.jsonl.
        measure: the function for a case, at module level because another process calls it.
        workers: cases at the same time. They share the cores, so times are only comparable with 1.
        budget: seconds; no case is begun that would probably end later. None: no limit.

    Raises:
        DigsError: two cases with the same key, or a folder that another run is measuring into.
    """
    if len({case.key for case in cases}) != len(cases):
        raise DigsError(
            "study: two cases have the same labels and settings; make the labels differ"
        )
    with sole_writer(folder):
        run = _Run(Store(folder), Path(folder), measure, workers, budget)
        waiting = [case for case in cases if not run.store.is_done(case.key)]
        done_before = len(cases) - len(waiting)
        with progress(len(cases), "Measuring", "case", initial=done_before) as bar:
            run.all(waiting, bar.update)
    return Outcome(done_before, run.done, run.failed, len(waiting) - run.done - run.failed)


class _Run:
    """The state of one call of `run_cases`."""

    def __init__(
        self, store: Store, folder: Path, measure: Measure, workers: int, budget: float | None
    ) -> None:
        self.store = store
        self.done = 0
        self.failed = 0
        self._folder = folder
        self._measure = measure
        self._workers = workers
        self._threads = max(1, default_threads() // workers)
        self._end = math.inf if budget is None else time.monotonic() + budget
        self._seconds = 0.0
        self._effort = 0.0

    def all(self, waiting: Sequence[Case], tick: Callable[[], object]) -> None:
        """Run the cases; ``tick`` is called after each."""
        queue = list(waiting)
        running: list[Worker] = []
        try:
            while queue or running:
                while queue and len(running) < self._workers:
                    case = queue.pop(0)
                    if self._has_time(case):
                        self._begin(case, running)
                if not running:
                    return  # the budget is used up
                ready = wait([worker.connection for worker in running])
                for worker in [w for w in running if w.connection in ready]:
                    running.remove(worker)
                    self._settle(worker)
                    tick()
        finally:
            for worker in running:
                worker.stop()

    def _begin(self, case: Case, running: list[Worker]) -> None:
        """Start a worker. Ctrl-C is deferred until the worker is in the list of those to stop."""
        with deferred_interrupt() as interruption:
            running.append(Worker(case, self._measure, self._folder, self._threads_of(case)))
        if interruption.asked is not None:
            interruption.end()

    def _has_time(self, case: Case) -> bool:
        """Whether the case would end in time, at the speed of the cases so far."""
        expected = case.effort * self._seconds / self._effort if self._effort else 0.0
        return time.monotonic() + expected <= self._end

    def _threads_of(self, case: Case) -> int:
        return case.threads or self._threads

    def _settle(self, worker: Worker) -> None:
        case = worker.case
        record = {
            "key": case.key,
            "labels": plain(case.labels),
            "recording": plain(case.recording),
            "reconstruction": plain(case.reconstruction),
            "threads": self._threads_of(case),
        }
        try:
            record |= worker.result()
            self.done += 1
            self._seconds += record["case_seconds"]
            self._effort += case.effort
        except DigsError as error:
            self.failed += 1
            record["error"] = str(error)
        self.store.add(record)
