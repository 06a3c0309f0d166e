"""Wall and CPU time, the shortest of several calls."""

import time
from collections.abc import Callable


class Stopwatch:
    """Seconds and CPU seconds of all threads spent in a ``with`` block."""

    seconds = 0.0
    cpu_seconds = 0.0

    def __enter__(self) -> "Stopwatch":
        self._start, self._cpu_start = time.perf_counter(), time.process_time()
        return self

    def __exit__(self, *error: object) -> None:
        self.seconds = time.perf_counter() - self._start
        self.cpu_seconds = time.process_time() - self._cpu_start


def best_ms(
    function: Callable[[], object],
    repeats: int,
    clock: Callable[[], float] = time.perf_counter,
) -> float:
    """Return the shortest of ``repeats`` calls [ms]."""
    seconds = []
    for _ in range(repeats):
        start = clock()
        function()
        seconds.append(clock() - start)
    return 1e3 * min(seconds)


def clock_for(threads: int) -> Callable[[], float]:
    """Return the CPU clock for one thread, which other programs disturb less, else the wall clock."""
    return time.process_time if threads == 1 else time.perf_counter
