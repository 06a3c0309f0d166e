"""Worker processes from outside: a crash or a hang is put down to its input, and the next process starts."""

import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from multiprocessing.process import BaseProcess
from pathlib import Path

from fuzzing.worker import Command, Outcome, digs_warp, work

_CONTEXT = multiprocessing.get_context("spawn")
_TICKS_PER_SECOND = os.sysconf("SC_CLK_TCK")

SECONDS_LIMIT = 10.0  # of the processor
MEGABYTES_LIMIT = 1000.0  # beyond what the process has before the input

# A process that waits for something takes no time of the processor.
WAITING_LIMIT = 90.0


@dataclass(frozen=True)
class Job:
    """Command lines to run in a folder, and the kind of input that they read."""

    kind: str
    folder: Path
    lines: Sequence[str]


class Worker:
    """A process that runs inputs; it starts when it is needed, again after each that ended it.

    Args:
        healthy: returns the healthy inputs of a kind. A process reads them before the first damaged one, so
            that imports and compiled kernels are not put down to that.
        command: what to run.
        seconds: the limit, of the processor.
        megabytes: the limit of the memory beyond what the process has before the input.
    """

    def __init__(
        self,
        healthy: Callable[[str], Sequence[Job]],
        command: Command = digs_warp,
        seconds: float = SECONDS_LIMIT,
        megabytes: float = MEGABYTES_LIMIT,
    ) -> None:
        self._healthy, self._command = healthy, command
        self._process: BaseProcess | None = None
        self._seconds, self._megabytes = seconds, megabytes
        self._known: set[str] = set()

    def run(self, job: Job) -> Outcome:
        """Run the command lines of an input."""
        if self._process is None:
            self._start()
        if job.kind not in self._known:
            self._known.add(job.kind)
            self._check_healthy(job.kind)
        return self._ask(job)

    def stop(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process = None

    def _start(self) -> None:
        self._connection, child = _CONTEXT.Pipe()
        process = _CONTEXT.Process(target=work, args=(child, self._command), daemon=True)
        process.start()
        self._process = process
        self._known.clear()
        child.close()
        self._connection.recv()  # until it has started

    def _check_healthy(self, kind: str) -> None:
        for job in self._healthy(kind):
            outcome = self._ask(job, is_healthy=True)
            if outcome.end not in ("read", "memory", "time"):
                raise RuntimeError(
                    f"{job}: a healthy input ends with {outcome.end}\n{outcome.detail}"
                )

    def _ask(self, job: Job, is_healthy: bool = False) -> Outcome:
        process = self._process
        assert process is not None
        start, used = time.monotonic(), _processor_seconds(process.pid)
        limits = (1e9, 1e9) if is_healthy else (WAITING_LIMIT, self._seconds)
        try:
            self._connection.send((job.folder, job.lines, is_healthy))
            while not self._connection.poll(0.5):
                spent = _processor_seconds(process.pid) - used
                if time.monotonic() - start > limits[0] or spent > limits[1]:
                    self.stop()
                    return Outcome("time", spent, 0.0, "did not end")
            outcome = self._connection.recv()
        except (EOFError, ConnectionError):
            process.join()
            self._process = None
            return Outcome("crash", 0.0, 0.0, _cause_of_death(process.exitcode or 0))
        if outcome.megabytes > self._megabytes:
            return replace(outcome, end="memory")
        is_late = outcome.seconds > self._seconds and not outcome.is_defect
        return replace(outcome, end="time") if is_late else outcome


def _processor_seconds(pid: int | None) -> float:
    """Return the time of the processor that a process took; 0 if it is gone."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_SECOND


def _cause_of_death(code: int) -> str:
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"
