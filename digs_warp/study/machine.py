"""The machine that the figures were measured on."""

import platform
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from digs_warp.words import counted

_INFO = Path("/proc/cpuinfo")


def processor() -> str:
    """Return the processor's name and number of cores."""
    if not _INFO.is_file():
        return platform.processor() or platform.machine()
    lines = _INFO.read_text(encoding="utf-8").splitlines()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    wide = ", AVX-512" if any("avx512f" in line for line in lines) else ""
    return f"{counted(len(names), 'core')} of {names[0] if names else platform.machine()}{wide}"


def worth_of_threads(threads: int, seconds: float = 2.0) -> float:
    """Return how much more arithmetic ``threads`` threads get done than one thread.

    This bounds the gain from threads for a program that only computes. Two logical processors of one core, as
    on many rented machines, get a value near 1.

    Args:
        threads: at least 1.
        seconds: measuring time for either number of threads.
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1), ThreadPoolExecutor(threads) as pool:

        def rate(count: int) -> float:
            return sum(pool.map(_products_per_second, [seconds] * count))

        alone = rate(1)
        return rate(threads) / alone


def _products_per_second(seconds: float) -> float:
    """Multiply small matrices, which fit into the cache of one core, for a while."""
    a = np.random.default_rng(0).normal(size=(192, 192)).astype(np.float32)
    done, start = 0, time.perf_counter()
    while (past := time.perf_counter() - start) < seconds:
        for _ in range(10):
            np.dot(a, a)
        done += 10
    return done / past
