"""The shortest of several calls, several calls at once, and memory."""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

_STATUS = Path("/proc/self/status")
_CLEAR_REFS = Path("/proc/self/clear_refs")


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
    before: Callable[[], object] | None = None,
    clock: Callable[[], float] = time.perf_counter,
) -> float:
    """Return the shortest of ``repeats`` calls [ms]; ``before`` runs ahead of each and does not count."""
    seconds = []
    for _ in range(repeats):
        if before is not None:
            before()
        start = clock()
        function()
        seconds.append(clock() - start)
    return 1e3 * min(seconds)


def ms_side_by_side(function: Callable[[], object], calls: int, rounds: int) -> tuple[float, float]:
    """Return wall time and CPU time per call of a function that runs several times at once [ms].

    The shortest of some rounds; a first call also loads and compiles, and does not count.

    Args:
        function: safe to call from several threads.
        calls: at a time.
        rounds: of calls.
    """
    function()
    best = (float("inf"), float("inf"))
    with ThreadPoolExecutor(calls) as pool:
        for _ in range(rounds):
            watch = Stopwatch()
            with watch:
                for call in [pool.submit(function) for _ in range(calls)]:
                    call.result()
            best = min(best, (watch.seconds, watch.cpu_seconds))
    wall, cpu = (1e3 * seconds / calls for seconds in best)
    return wall, cpu


def clock_for(threads: int) -> Callable[[], float]:
    """Return the CPU clock for one thread, which other programs disturb less, else the wall clock."""
    return time.process_time if threads == 1 else time.perf_counter


class PeakMemory:
    """The memory that the process holds: at the start of a block, and the most within it [bytes]."""

    start = 0
    peak = 0

    @property
    def growth(self) -> int:
        """How much more it was at the peak."""
        return max(0, self.peak - self.start)


@contextmanager
def peak_memory() -> Iterator[PeakMemory]:
    """Measure the resident memory of a block, mapped files included; zeros where the system has no /proc."""
    found = PeakMemory()
    try:
        _CLEAR_REFS.write_text("5")  # resets the peak
        found.start = _bytes("VmRSS")
    except OSError:
        yield found
        return
    yield found
    found.peak = _bytes("VmHWM")


def _bytes(name: str) -> int:
    return 1024 * int(_STATUS.read_text().split(f"{name}:")[1].split()[0])
