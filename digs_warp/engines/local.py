"""Processes on this machine."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from digs_warp.engines.child import packed
from digs_warp.engines.children import Children
from digs_warp.engines.engine import Engine
from digs_warp.engines.needs import ONE_THREAD, Needs


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
