"""Jobs of a batch system through submitit: of Slurm, or on this machine to try it."""

import math
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Literal

import submitit

from digs_warp.checks import DigsError
from digs_warp.engines.engine import ONE_THREAD, CallFailed, Engine, FailureClass, Needs
from digs_warp.engines.processes import packed, run_apart

LOGS = "jobs"
SECONDS_BETWEEN_LOOKS = {"slurm": 5.0, "local": 0.1}

# States of Slurm that say why a job ended, beside those in which its node was lost.
_CLASSES = {"TIMEOUT": FailureClass.TIME_LIMIT, "OUT_OF_MEMORY": FailureClass.OUT_OF_MEMORY}


class BatchJobs(Engine):
    """One job for each call, at most ``jobs`` of them waiting or running at a time.

    Args:
        system: slurm, or local: processes on this machine.
        jobs: at a time.
        folder: the jobs' scripts, logs and answers go to jobs/ in it, which every machine sees.

    Raises:
        DigsError: there is no Slurm here.
    """

    def __init__(self, system: Literal["slurm", "local"], jobs: int, folder: Path) -> None:
        self._logs = folder / LOGS
        self._jobs = jobs
        self._pause = SECONDS_BETWEEN_LOOKS[system]
        try:
            self._system = submitit.AutoExecutor(self._logs, cluster=system)
        except RuntimeError as error:
            raise DigsError(
                f"--engine {system}: {error}; run this on a machine where 'sbatch' works"
            ) from error
        self._running: dict[Future[Any], Any] = {}
        self._lock = threading.Lock()
        self._is_over = threading.Event()
        self._watch = threading.Thread(target=self._look, name="batch jobs", daemon=True)
        self._watch.start()

    @property
    def slots(self) -> int:
        """The number of jobs at a time."""
        return self._jobs

    def submit(
        self, fn: Callable[..., Any], /, *args: Any, needs: Needs = ONE_THREAD
    ) -> "Future[Any]":
        """Have ``fn(*args)`` called; see `Engine`. SBATCH_PARTITION and the like choose the partition."""
        wanted: dict[str, Any] = {"name": "digs-warp", "cpus_per_task": needs.threads}
        if needs.memory_gb is not None:
            wanted["mem_gb"] = needs.memory_gb
        if needs.seconds is not None:  # the job's own time comes after that of its call
            wanted["timeout_min"] = math.ceil(needs.seconds / 60) + 1
        self._system.update_parameters(**wanted)
        future: Future[Any] = Future()
        future.set_running_or_notify_cancel()
        with self._lock:
            self._running[future] = self._system.submit(_in_job, packed(fn, *args), needs)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Wait for all jobs, or cancel them when ``cancel_futures`` is set."""
        while wait and not cancel_futures and self._running:
            time.sleep(self._pause)
        self._is_over.set()
        self._watch.join()
        for job in self._running.values():
            job.cancel(check=False)

    def _look(self) -> None:
        """Answer the futures of jobs that have ended, until the engine is shut down."""
        while not self._is_over.wait(self._pause):
            with self._lock:
                ended = [(future, job) for future, job in self._running.items() if job.done()]
                for future, _ in ended:
                    del self._running[future]
            for future, job in ended:
                _answer(future, job)


def _in_job(call: bytes, needs: Needs) -> tuple[CallFailed | None, Any]:
    """Make a call; a failure is returned, for submitit keeps only the text of exceptions."""
    try:
        return None, run_apart(call, needs)
    except CallFailed as failure:
        return failure, None


def _answer(future: "Future[Any]", job: Any) -> None:
    try:
        failure, value = job.result()
    except Exception as error:  # submitit's own, of several kinds
        kind = _CLASSES.get(job.state, FailureClass.WORKER_LOST)
        reason = str(error).strip().partition("\n")[0]
        failure, value = CallFailed(kind, f"{reason} (job {job.job_id}, {job.state})"), None
    if failure is None:
        future.set_result(value)
    else:
        future.set_exception(failure)
