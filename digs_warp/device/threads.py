"""The number of threads, and NumPy work spread over them."""

import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

from digs_warp.checks import DigsError

_T = TypeVar("_T")

# Rows per slice. Enough that threads rarely wait for the interpreter lock, which costs more than arrays that
# do not fit into the cache; few enough that intermediate arrays take about ten megabytes per thread.
CHUNK = 32768


# The limit of `limited_threads`, of each thread by itself.
_own = threading.local()


@contextmanager
def limited_threads(count: int) -> Iterator[None]:
    """Let what the calling thread does in the block use at most ``count`` threads, >= 1.

    For work that is shared out in large pieces, one per thread: what is inside a piece has no cores left.
    """
    before = getattr(_own, "limit", None)
    _own.limit = count
    try:
        yield
    finally:
        _own.limit = before


def default_threads() -> int:
    """Return the number of cores that the calling thread may use.

    It is that of the process; DIGS_WARP_THREADS overrides it, and `limited_threads` limits it.
    """
    limit = getattr(_own, "limit", None)
    return _cores() if limit is None else min(limit, _cores())


def _cores() -> int:
    override = os.environ.get("DIGS_WARP_THREADS", "")
    if override:
        if not override.isdecimal() or int(override) == 0:
            raise DigsError(
                f"DIGS_WARP_THREADS='{override}': expected a number of threads, 1 or more"
            )
        return int(override)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def over_rows(count: int, work: Callable[[slice], _T], chunk: int = CHUNK) -> list[_T]:
    """Return ``work(rows)`` for slices that cover 0..count-1, in order, computed on all cores.

    NumPy releases the interpreter lock while it computes, so threads help. The results do not depend on the
    number of threads, because the slices are always the same. The first error of ``work`` is raised; slices
    that have not started by then are skipped.
    """
    from threadpoolctl import threadpool_limits

    slices = [slice(first, min(first + chunk, count)) for first in range(0, count, chunk)]
    threads = min(len(slices), default_threads())
    if threads <= 1:
        return [work(rows) for rows in slices]
    # Concurrent matrix products would each try to use all cores, and wait for each other.
    with threadpool_limits(1, user_api="blas"), ThreadPoolExecutor(threads) as pool:
        try:
            return list(pool.map(work, slices))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
