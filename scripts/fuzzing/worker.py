"""Processes that run command lines on damaged inputs: a crash or a hang is put down to its input."""

import contextlib
import gc
import io
import logging
import multiprocessing
import os
import resource
import signal
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Literal

End = Literal["read", "refused", "traceback", "crash", "memory", "time"]
# Runs the words of a command line and returns the exit code.
Command = Callable[[Sequence[str]], int]

_CONTEXT = multiprocessing.get_context("spawn")
_TICKS_PER_SECOND = os.sysconf("SC_CLK_TCK")

SECONDS_LIMIT = 10.0  # of the processor
MEGABYTES_LIMIT = 1000.0  # beyond what the process has before the input
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
        self._process: BaseProcess | None = None
        self._seconds, self._megabytes = seconds, megabytes
        self._known: set[str] = set()

    def run(self, job: Job) -> Outcome:
        """Run the command lines of an input."""
        if self._process is None:
            self._start()
        if job.kind not in self._known:
            self._known.add(job.kind)
            for each in self._healthy(job.kind):
                outcome = self._ask(each, is_healthy=True)
                if outcome.end not in ("read", "memory", "time"):
                    raise RuntimeError(
                        f"{each}: a healthy input ends with {outcome.end}\n{outcome.detail}"
                    )
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
            outcome: Outcome = self._connection.recv()
        except (EOFError, ConnectionError):
            process.join()
            self._process = None
            code = process.exitcode or 0
            cause = signal.Signals(-code).name if code < 0 else f"exit code {code}"
            return Outcome("crash", 0.0, 0.0, cause)
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


def work(connection: Connection, command: Command) -> None:
    """Answer each (folder, lines, is_healthy) with an `Outcome`; healthy inputs may take what they need.

    Runs in the process. Says "ready" first: what it takes to start is put down to no input.
    """
    logging.disable(logging.WARNING)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # C libraries complain there
    connection.send("ready")
    while (job := connection.recv()) is not None:
        folder, lines, is_healthy = job
        limit = resource.RLIM_INFINITY if is_healthy else _status("VmSize") + ADDRESS_SPACE
        resource.setrlimit(resource.RLIMIT_AS, (limit, resource.RLIM_INFINITY))
        connection.send(run_input(folder, lines, command))


def run_input(folder: Path, lines: Sequence[str], command: Command) -> Outcome:
    """Run command lines in a folder and measure them."""
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
    megabytes = max(0, _status("VmHWM") - before) / 1e6
    gc.collect()
    return Outcome(end, seconds, megabytes, said.getvalue()[-6000:])


def _status(name: str) -> int:
    """Return a size of this process [bytes]."""
    return int(Path("/proc/self/status").read_text().split(f"{name}:")[1].split()[0]) * 1024
