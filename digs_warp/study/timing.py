"""How long a piece of work takes, and the machine that it was measured on."""

import platform
import time
from pathlib import Path

from digs_warp.words import counted

_INFO = Path("/proc/cpuinfo")


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


def processor() -> str:
    """Return the processor's name and number of cores."""
    if not _INFO.is_file():
        return platform.processor() or platform.machine()
    lines = _INFO.read_text(encoding="utf-8").splitlines()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    wide = ", AVX-512" if any("avx512f" in line for line in lines) else ""
    return f"{counted(len(names), 'core')} of {names[0] if names else platform.machine()}{wide}"
