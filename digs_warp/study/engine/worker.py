"""Each case runs in its own process, which isolates its peak memory and its crashes."""

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.study.engine.case import Case

Measure = Callable[[Case, Path], dict[str, Any]]

# spawn: a forked child would inherit Warp's threads in an undefined state.
_CONTEXT = multiprocessing.get_context("spawn")


class Worker:
    """A process that measures ``case``; wait for ``connection``, then call `result`."""

    def __init__(self, case: Case, measure: Measure, folder: Path, threads: int) -> None:
        self.case = case
        self.connection, sender = _CONTEXT.Pipe(duplex=False)
        self._process = _CONTEXT.Process(
            target=_work, args=(sender, case, measure, folder, threads), daemon=True
        )
        self._process.start()
        sender.close()  # the child's copy is the only one left: its death ends the connection

    def result(self) -> dict[str, Any]:
        """Wait for the measurement and return it, with ``case_seconds``.

        Raises:
            DigsError: the case failed; the message is that of its error, or how the process died.
        """
        try:
            error, measured = self.connection.recv()
        except EOFError:
            error, measured = None, None
        self._process.join()
        if measured is not None:
            return measured
        code = self._process.exitcode or 0
        raise DigsError(error or f"its process ended with {_cause_of_death(code)}")

    def stop(self) -> None:
        """End the process."""
        self._process.terminate()
        self._process.join()


def _work(sender: Connection, case: Case, measure: Measure, folder: Path, threads: int) -> None:
    # Ctrl-C and a closed terminal reach the whole process group; the parent stops the workers.
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    os.environ["DIGS_WARP_THREADS"] = str(threads)
    start = time.monotonic()
    try:
        measured = measure(case, folder)
    except Exception as error:  # one bad case must not stop a night of measuring
        sender.send((f"{type(error).__name__}: {error}", None))
        return
    sender.send((None, measured | {"case_seconds": round(time.monotonic() - start, 3)}))


def _end_with_the_parent() -> None:
    """End this process when its parent is gone: a killed parent cannot stop its workers."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _cause_of_death(code: int) -> str:
    if code >= 0:
        return f"exit code {code}"
    return f"signal {signal.Signals(-code).name}" + (" (out of memory?)" if code == -9 else "")
