"""Makes many calls on an engine: what is done is not done again, what dies is tried once more."""

import logging
import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.engines.engine import RETRIED, CallFailed, Engine, EngineLost, FailureClass
from digs_warp.engines.task import FINISHED, Results, Task, finished_file, perform
from digs_warp.record.files import read_json
from digs_warp.record.progress import progress
from digs_warp.words import counted

_log = logging.getLogger(__name__)

ATTEMPTS = 2  # of a case whose worker dies


@dataclass(frozen=True)
class Outcome:
    """The outcome of a run: numbers of cases."""

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


@dataclass(frozen=True)
class _Attempt:
    task: Task
    number: int = 1


def run_tasks(
    tasks: Sequence[Task],
    results: Results,
    folder: Path,
    engine: Engine,
    *,
    budget: float | None = None,
    label: str = "Measuring",
    unit: str = "case",
) -> Outcome:
    """Run every task that has no result, in order; each ends as a line of ``results``.

    A failed task is recorded with its error, does not stop the others, and runs again next time. All that
    is known is in the folder: a worker leaves its result there before it answers.

    Args:
        tasks: the most important first; their keys differ.
        results: what is there; lines are added.
        folder: the workers leave results in it until a line is written.
        engine: makes the calls.
        budget: seconds; no task is begun that would probably end later. None: no limit.
        label: of the progress.
        unit: what a task is called there.

    Raises:
        EngineLost: the engine is gone; what is done is kept.
    """
    run = _Run(results, folder, engine, budget)
    for task in tasks:
        run.collect(task)
    waiting = [task for task in tasks if not results.is_done(task.key)]
    done_before = len(tasks) - len(waiting)
    with progress(len(tasks), label, unit, initial=done_before) as bar:

        def tick() -> None:
            bar.update()
            bar.set_postfix_str(f"{run.failed} failed" if run.failed else "")

        run.all(waiting, tick)
    with suppress(OSError):  # not empty: calls of an earlier run have still to end
        (Path(folder) / FINISHED).rmdir()
    return Outcome(done_before, run.done, run.failed, len(waiting) - run.done - run.failed)


class _Run:
    """The state of one call of `run_tasks`."""

    def __init__(
        self, results: Results, folder: Path, engine: Engine, budget: float | None
    ) -> None:
        self.done = 0
        self.failed = 0
        self._results = results
        self._folder = Path(folder).resolve()
        self._engine = engine
        self._end = math.inf if budget is None else time.monotonic() + budget
        self._seconds = 0.0

    def collect(self, task: Task) -> None:
        """Write the line of a result that a worker left, of which an earlier run did not hear."""
        place = finished_file(self._folder, task.key)
        if place.is_file():
            if not self._results.is_done(task.key):
                self._add(task, read_json(place, "result"))
            place.unlink()

    def all(self, waiting: Sequence[Task], tick: Callable[[], object]) -> None:
        """Run the tasks; ``tick`` is called after each."""
        queue = [_Attempt(task) for task in waiting]
        running: dict[Future[Any], _Attempt] = {}
        while queue or running:
            while queue and len(running) < self._engine.slots:
                attempt = queue.pop(0)
                if self._has_time():
                    running[self._submit(attempt.task)] = attempt
            if not running:
                return  # the budget is used up
            ready, _ = wait(running, return_when=FIRST_COMPLETED)
            while ready:
                # Dask calculates what a lost worker held again, unless it is forgotten.
                future = ready.pop()
                again = self._settle(running.pop(future), future)
                del future
                if again is not None:
                    queue.insert(0, again)
                else:
                    tick()

    def _submit(self, task: Task) -> "Future[Any]":
        place = finished_file(self._folder, task.key)
        return self._engine.submit(perform, place, task.function, task.arguments, needs=task.needs)

    def _has_time(self) -> bool:
        """Whether one more task would end in time, if it takes as long as those so far."""
        expected = self._seconds / self.done if self.done else 0.0
        return time.monotonic() + expected <= self._end

    def _settle(self, attempt: _Attempt, future: "Future[Any]") -> _Attempt | None:
        """Write the line of a task; return what to try again."""
        task = attempt.task
        try:
            result = future.result()
        except CancelledError as error:
            raise EngineLost(
                f"the engine lost its scheduler after {counted(self.done, 'case')}; what is done is kept: "
                "start it again, and run the same command again"
            ) from error
        except Exception as error:
            failure = error if isinstance(error, CallFailed) else _lost(error)
            if failure.kind in RETRIED and attempt.number < ATTEMPTS:
                return _Attempt(task, attempt.number + 1)
            self._fail(attempt, failure)
            return None
        self._add(task, result)
        finished_file(self._folder, task.key).unlink(missing_ok=True)
        self.done += 1
        self._seconds += result["case_seconds"]
        return None

    def _add(self, task: Task, result: dict[str, Any]) -> None:
        self._results.add({"key": task.key, **task.facts, **result})

    def _fail(self, attempt: _Attempt, failure: CallFailed) -> None:
        self.failed += 1
        _log.error("%s failed: %s", attempt.task.name, failure)
        words = {"error": str(failure), "failure": str(failure.kind), "attempts": attempt.number}
        self._results.add({"key": attempt.task.key, **attempt.task.facts, **words})


def _lost(error: Exception) -> CallFailed:
    """Return what happened to a worker of the engine, whose own exception this is."""
    reason = " ".join(str(error).split()) or type(error).__name__
    return CallFailed(FailureClass.WORKER_LOST, f"its worker was lost ({reason})")


def check_keys(tasks: Sequence[Task], message: str) -> None:
    """Raise a `DigsError` when two tasks have the same key: one would take the result of the other."""
    if len({task.key for task in tasks}) != len(tasks):
        raise DigsError(message)
