"""The number of threads, and NumPy work spread over them."""

import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

from digs_warp.checks import DigsError

_I = TypeVar("_I")
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
    slices = [slice(first, min(first + chunk, count)) for first in range(0, count, chunk)]
    if min(len(slices), default_threads()) <= 1:
        return [work(rows) for rows in slices]
    return _mapped(work, slices)


def over_items(items: Sequence[_I], work: Callable[[_I], _T]) -> list[_T]:
    """Return ``work(item)`` for all items, in order, computed on all cores.

    Each item has one core for itself, so the results do not depend on the number of threads: those of matrix
    products would. The first error of ``work`` is raised; items that have not started by then are skipped.
    """
    if getattr(_own, "alone", False):
        return [work(item) for item in items]

    def alone(item: _I) -> _T:
        _own.alone = True
        try:
            with limited_threads(1):
                return work(item)
        finally:
            _own.alone = False

    return _mapped(alone, items)


def _mapped(work: Callable[[_I], _T], items: Sequence[_I]) -> list[_T]:
    """Return ``work(item)`` for all items, in order, on all cores."""
    from threadpoolctl import threadpool_limits

    threads = min(len(items), default_threads())
    # Concurrent matrix products would each try to use all cores, and wait for each other.
    with threadpool_limits(1, user_api="blas"):
        if threads <= 1:
            return [work(item) for item in items]
        with ThreadPoolExecutor(threads) as pool:
            try:
                return list(pool.map(work, items))
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise
