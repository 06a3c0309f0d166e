"""A process that runs command lines on damaged inputs: a crash or a hang is put down to its input."""

import contextlib
import gc
import io
import logging
import os
import resource
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Literal

from digs_warp.device.threads import default_threads
from digs_warp.engines.engine import CallFailed, FailureClass
from digs_warp.engines.processes import Child, packed

End = Literal["read", "refused", "traceback", "crash", "memory", "time"]
# Runs the words of a command line and returns the exit code.
Command = Callable[[Sequence[str]], int]

SECONDS_LIMIT = 10.0  # of the processor
MEGABYTES_LIMIT = 1000.0  # beyond what the process has before the input
# Kernels may count their limit in ticks, here a twentieth more than a process takes, since it began.
TICKS = 1.25
WAITING_LIMIT = 90.0  # a process that waits for something takes no time of the processor
# Address space is more than memory in use: stacks and arenas of threads, files that are mapped.
ADDRESS_SPACE = 3 << 30


@dataclass(frozen=True)
class Job:
    """Command lines to run in a folder, and the kind of input that they read."""

    kind: str
    folder: Path
    lines: Sequence[str]


@dataclass(frozen=True)
class Outcome:
    """How an input ended.

    Attributes:
        end: read, refused with a message, or a defect.
        seconds: time of the processor.
        megabytes: the most memory that was in use at once, beyond that before.
        detail: message, traceback or signal.
    """

    end: End
    seconds: float
    megabytes: float
    detail: str = ""

    @property
    def is_defect(self) -> bool:
        """Whether the package has to be mended."""
        return self.end not in ("read", "refused")


def digs_warp(words: Sequence[str]) -> int:
    """Run a command line of the package in this process."""
    from digs_warp.cli import main

    return main(words)


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
        self._child: Child | None = None
        self._seconds, self._megabytes = seconds, megabytes
        self._known: set[str] = set()

    def run(self, job: Job) -> Outcome:
        """Run the command lines of an input."""
        if self._child is None or not self._child.is_alive:
            self._child = Child(default_threads())
            self._known.clear()
        if job.kind not in self._known:
            self._known.add(job.kind)
            for each in self._healthy(job.kind):
                outcome = self._ask(self._child, each, is_healthy=True)
                if outcome.end not in ("read", "memory", "time"):
                    raise RuntimeError(
                        f"{each}: a healthy input ends with {outcome.end}\n{outcome.detail}"
                    )
        return self._ask(self._child, job)

    def stop(self) -> None:
        """End the process."""
        if self._child is not None:
            self._child.stop()
            self._child = None

    def _ask(self, child: Child, job: Job, is_healthy: bool = False) -> Outcome:
        seconds = None if is_healthy else self._seconds
        call = packed(run_input, job.folder, job.lines, self._command, seconds)
        try:
            outcome: Outcome = child.result(call, None if is_healthy else WAITING_LIMIT)
        except CallFailed as error:
            self.stop()
            is_late = error.kind is FailureClass.TIME_LIMIT or "SIGXCPU" in str(error)
            return Outcome("time" if is_late else "crash", 0.0, 0.0, str(error))
        if outcome.megabytes > self._megabytes:
            return replace(outcome, end="memory")
        is_late = outcome.seconds > self._seconds and not outcome.is_defect
        return replace(outcome, end="time") if is_late else outcome


@cache
def _silence() -> None:
    """Let this process log nothing, and C libraries complain nowhere."""
    logging.disable(logging.WARNING)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)


def _limit(limit: int, now: float, more: float | None) -> None:
    """Limit what this process takes to what it has now and some more; None: to nothing."""
    most = resource.RLIM_INFINITY if more is None else int(now + more)
    resource.setrlimit(limit, (most, resource.RLIM_INFINITY))


def run_input(
    folder: Path, lines: Sequence[str], command: Command, seconds_limit: float | None
) -> Outcome:
    """Run command lines in a folder and measure them; without a limit they may take what they need.

    Runs in the process: what it takes to start is put down to no input.
    """
    _silence()
    is_free = seconds_limit is None
    _limit(resource.RLIMIT_AS, _status("VmSize"), None if is_free else ADDRESS_SPACE)
    taken = TICKS * time.process_time()
    _limit(resource.RLIMIT_CPU, taken, None if is_free else seconds_limit + 2)
    os.chdir(folder)
    Path("/proc/self/clear_refs").write_text("5")  # the peak starts at what is in use now
    before, start = _status("VmRSS"), time.process_time()
    said = io.StringIO()
    end: End = "read"
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            for number, line in enumerate(lines):
                if command([word.replace("OUT", f"out{number}") for word in line.split()]):
                    end = "refused"
    except SystemExit as error:
        end = "refused" if error.code else end
    except BaseException:
        end, said = "traceback", io.StringIO(traceback.format_exc())
    seconds = time.process_time() - start
    _limit(
        resource.RLIMIT_CPU, 0, None
    )  # what threads take until the next input is put down to none
    megabytes = max(0, _status("VmHWM") - before) / 1e6
    gc.collect()
    return Outcome(end, seconds, megabytes, said.getvalue()[-6000:])


def _status(name: str) -> int:
    """Return a size of this process [bytes]."""
    return int(Path("/proc/self/status").read_text().split(f"{name}:")[1].split()[0]) * 1024
