"""A process that runs command lines of the package on damaged inputs, one input after the other."""

import contextlib
import gc
import io
import logging
import os
import resource
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Literal

End = Literal["read", "refused", "traceback", "crash", "memory", "time"]

# Address space is more than memory in use: stacks and arenas of threads, files that are mapped.
ADDRESS_SPACE = 3 << 30


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


# Runs the words of a command line and returns the exit code.
Command = Callable[[Sequence[str]], int]


def work(connection: Connection, command: Command) -> None:
    """Answer each (folder, lines, is_healthy) with an `Outcome`; healthy inputs may take what they need.

    Says "ready" first: what the process takes to start is put down to no input.
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
    before, start = _forget_peak(), time.process_time()
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


def _forget_peak() -> int:
    """Let the peak of the memory start at what is in use now, and return that [bytes]."""
    Path("/proc/self/clear_refs").write_text("5")
    return _status("VmRSS")


def _status(name: str) -> int:
    """Return a size of this process [bytes]."""
    return int(Path("/proc/self/status").read_text().split(f"{name}:")[1].split()[0]) * 1024


def digs_warp(words: Sequence[str]) -> int:
    """Run a command line of the package in this process."""
    from digs_warp.cli import main

    return main(words)
