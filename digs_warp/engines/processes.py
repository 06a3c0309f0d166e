"""Processes on this machine that make calls; they isolate peak memory and crashes.

A child is a fresh interpreter: a forked one would inherit Warp's threads in an undefined state, and
processes of `multiprocessing` may have no children inside Dask's workers.
"""

import json
import logging
import os
import pickle
import select
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.engines.engine import ONE_THREAD, CallFailed, Engine, FailureClass, Needs

# Seconds that a process has to end by itself.
GRACE = 5.0

# argv: the search path of the parent, where this file is found; the descriptor for the answer.
_START = """
import json, sys
sys.path += [each for each in json.loads(sys.argv[1]) if each not in sys.path]
from digs_warp.engines.processes import answer
answer(int(sys.argv[2]))
"""


def packed(function: Callable[..., Any], *arguments: Any) -> bytes:
    """Return a call that a `Child` can make, also on another machine; ``function`` is at module level.

    It is found where this process finds it, or where the other one does. Relative paths are those of
    here, and what is logged here is logged there.
    """
    here = (sys.path, os.getcwd(), _log_levels())
    return pickle.dumps((here, pickle.dumps((function, arguments))))


class Child:
    """A process that makes one call after the other. It ends when its parent does, however that ends.

    Args:
        threads: of its calls.
    """

    def __init__(self, threads: int) -> None:
        self.threads = threads
        reader, writer = os.pipe()
        command = [sys.executable, "-P", "-c", _START, json.dumps(sys.path), str(writer)]
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                pass_fds=[writer],
                env=os.environ | {"DIGS_WARP_THREADS": str(threads)},
            )
        except BaseException:
            os.close(reader)
            raise
        finally:
            os.close(writer)  # the child's copy is the only one left: its death ends the answers
        assert self._process.stdin is not None
        self._answers = Connection(reader, writable=False)
        # Stays open: the child ends with it.
        self._calls = Connection(os.dup(self._process.stdin.fileno()), readable=False)
        self._process.stdin.close()

    @property
    def is_alive(self) -> bool:
        """Whether it can take a call."""
        return self._process.poll() is None

    def result(self, call: bytes, limit: float | None) -> Any:
        """Have a call made, for ``limit`` seconds at most, and return what it returns.

        Raises:
            CallFailed: it raised an exception, took longer than it may, or its process died.
        """
        try:
            self._calls.send_bytes(call)
            if not self._answers.poll(limit):
                self.stop()
                message = f"took longer than {limit:g} s; allow more time, or make it smaller"
                raise CallFailed(FailureClass.TIME_LIMIT, message)
            failure, value = self._answers.recv()
        except (EOFError, BrokenPipeError):
            raise _cause_of_death(self._process.wait()) from None
        if failure is not None:
            raise CallFailed(*failure)
        return value

    def stop(self) -> None:
        """End the process; one that handles the signal and goes on is killed."""
        self._process.terminate()
        try:
            self._process.wait(GRACE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def answer(descriptor: int) -> None:
    """Make the calls that come from standard input and answer each: what the child does."""
    # Ctrl-C and a closed terminal reach the whole process group; the parent stops its children.
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    os.set_inheritable(descriptor, False)  # what a call starts may outlive it
    threading.Thread(target=_end_with_parent, daemon=True).start()
    calls = Connection(os.dup(0), writable=False)
    with Connection(descriptor, readable=False) as parent, suppress(EOFError, OSError):
        while True:
            parent.send(_outcome(calls.recv_bytes()))


def _end_with_parent() -> None:
    """End this process when nobody can send calls any more: a killed parent cannot stop its children."""
    standard_input = select.poll()
    standard_input.register(0, 0)
    standard_input.poll()
    os._exit(1)


def _outcome(call: bytes) -> tuple[tuple[FailureClass, str] | None, Any]:
    try:
        here, inner = pickle.loads(call)
        _settle(*here)
        function, arguments = pickle.loads(inner)
        return None, function(*arguments)
    except MemoryError as error:
        return (FailureClass.OUT_OF_MEMORY, f"MemoryError: {error}"), None
    except (DigsError, OSError) as error:  # the message says it all
        return (FailureClass.ERROR, str(error)), None
    except Exception as error:  # one bad case must not stop a night of measuring
        traceback.print_exc()
        return (FailureClass.ERROR, f"{type(error).__name__}: {error}"), None


def _settle(search_path: list[str], folder: str, levels: dict[str, int]) -> None:
    """Take the place of the process that a call comes from."""
    sys.path += [each for each in search_path if each not in sys.path]
    with suppress(OSError):  # a machine without it: a relative path is then named as missing
        os.chdir(folder)
    logging.basicConfig(format="%(levelname)s: %(message)s")
    for name, level in levels.items():
        logging.getLogger(name).setLevel(level)


def _log_levels() -> dict[str, int]:
    """Return the levels of the root logger, "", and of our own."""
    ours = [name for name in logging.root.manager.loggerDict if name.startswith("digs_warp")]
    return {name: logging.getLogger(name).level for name in ("", *ours)}


def _cause_of_death(code: int) -> CallFailed:
    how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
    guess = " (out of memory?)" if -code == signal.SIGKILL else ""
    return CallFailed(FailureClass.DIED, f"its process ended with {how}{guess}")


class Children:
    """A child process for each thread that asks; kept for its next call if the last one ended well."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._mine = threading.local()  # child
        self._all: set[Child] = set()
        self._is_over = False

    def run(self, call: bytes, needs: Needs) -> Any:
        """Make a call from `digs_warp.engines.processes.packed` in a child and return what it returns.

        Raises:
            CallFailed: it has no result.
        """
        kept: Child | None = getattr(self._mine, "child", None)
        if kept and (needs.alone or kept.threads != needs.threads or not kept.is_alive):
            self._end(kept)
            kept = None
        if kept is None:
            with self._lock:
                if self._is_over:
                    raise RuntimeError("the engine was shut down")
                kept = self._mine.child = Child(needs.threads)
                self._all.add(kept)
        try:
            value = kept.result(call, needs.seconds)
        except BaseException:
            self._end(kept)
            raise
        if needs.alone:
            self._end(kept)
        return value

    def stop(self) -> None:
        """End all of them, also those that have a call; from now on there are no calls."""
        with self._lock:
            self._is_over = True
            children = [*self._all]
        for child in children:
            child.stop()

    def _end(self, child: Child) -> None:
        child.stop()
        self._mine.child = None
        with self._lock:
            self._all.discard(child)


_children = Children()


def run_apart(call: bytes, needs: Needs) -> Any:
    """Make a call in a child of this process: what a worker of a cluster does. See `Children.run`."""
    return _children.run(call, needs)


class LocalProcesses(Engine):
    """Up to ``workers`` calls at a time, each in a process that a thread of this one waits for."""

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._pool = ThreadPoolExecutor(workers, thread_name_prefix="worker")
        self._children = Children()

    @property
    def slots(self) -> int:
        """The number of workers."""
        return self._workers

    def submit(
        self, fn: Callable[..., Any], /, *args: Any, needs: Needs = ONE_THREAD
    ) -> "Future[Any]":
        """Have ``fn(*args)`` called; see `Engine`."""
        return self._pool.submit(self._children.run, packed(fn, *args), needs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Wait for all calls, or end them when ``cancel_futures`` is set."""
        if wait and not cancel_futures:
            self._pool.shutdown()
        self._children.stop()
        self._pool.shutdown(cancel_futures=True)
