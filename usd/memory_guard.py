"""Keeps a broken file from taking all memory: a few bytes of a USD file may promise billions of values.

The USD library allocates what a file promises before it looks whether the file holds as much. Under a
limit such an allocation fails at once, which the library reports as a broken file.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# What reading may take beyond what the process has: this much for the library and its threads, and this
# much per byte of the file for all arrays and their copies.
HEADROOM = 512 << 20
PER_BYTE = 24

_lock = threading.Lock()


@contextmanager
def limited_memory(file_size: int) -> Iterator[None]:
    """Limit the data of this process while the block reads a file of ``file_size`` bytes.

    The limit is the process's own (RLIMIT_DATA), so it also holds for other threads during the block;
    where a second thread reads at the same time, or the system has no such limit, nothing is limited.
    """
    try:
        import resource

        used = _data_bytes()
    except (ImportError, OSError):
        yield
        return
    if not _lock.acquire(blocking=False):
        yield
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    limit = used + HEADROOM + PER_BYTE * file_size
    tighter = [limit, *(bound for bound in (soft, hard) if bound != resource.RLIM_INFINITY)]
    try:
        resource.setrlimit(resource.RLIMIT_DATA, (min(tighter), hard))
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
        _lock.release()


def _data_bytes() -> int:
    """Return the size of the private, writable memory of this process (Linux)."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmData:")[1].split()[0]) * 1024
