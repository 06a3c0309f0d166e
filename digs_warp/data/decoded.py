"""Keeps decoded image files for a while: what precedes a training reads most of them several times.

Threads that ask for a file while another one decodes it wait for that.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from threading import Lock

import numpy as np

# Memory for decoded files [bytes]. Beyond it, files are decoded whenever they are read.
MEMORY = 256 * 2**20


class _Kept:
    """What all threads of the process share. Blocks may overlap: the last one that ends drops everything."""

    def __init__(self) -> None:
        self.lock = Lock()
        self.blocks = 0
        self.bytes = 0
        # By path, time of the last change [ns], and size [bytes].
        self.pixels: dict[tuple[str, int, int], Future[np.ndarray]] = {}


_kept = _Kept()


@contextmanager
def decoded_once() -> Iterator[None]:
    """Within the block, `decoded` reads each file once, as far as `MEMORY` goes."""
    with _kept.lock:
        _kept.blocks += 1
    try:
        yield
    finally:
        with _kept.lock:
            _kept.blocks -= 1
            if not _kept.blocks:
                _kept.pixels.clear()
                _kept.bytes = 0


def decoded(path: Path, read: Callable[[Path], np.ndarray]) -> np.ndarray:
    """Return the pixels of a file, from memory if it was decoded before; the caller may change them.

    Args:
        path: the file; one that changed since is read again.
        read: decodes it, or raises what is to be said about it.
    """
    if not _kept.blocks or not path.exists():
        return read(path)
    found, mine = path.stat(), Future[np.ndarray]()
    key = (str(path), found.st_mtime_ns, found.st_size)
    with _kept.lock:
        known = _kept.pixels.setdefault(key, mine)
    if known is not mine:
        return known.result().copy()
    try:
        pixels = read(path)
    except BaseException as error:
        mine.set_exception(error)
        raise
    mine.set_result(pixels.copy())
    with _kept.lock:
        _kept.bytes += pixels.nbytes
        if _kept.bytes > MEMORY:
            _kept.bytes -= pixels.nbytes
            _kept.pixels.pop(key, None)
    return pixels
