"""Keeps decoded image files for a while: what precedes a training reads most of them several times.

Threads that ask for a file while another one decodes it wait for that.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock

import numpy as np

# Memory for decoded files [bytes]. Beyond it, files are decoded whenever they are read.
MEMORY = 256 * 2**20

# Path, time of the last change [ns], and size [bytes].
_Key = tuple[str, int, int]


class _Kept:
    """What all threads of the process share. Blocks may overlap: the last one that ends drops everything."""

    def __init__(self) -> None:
        self.lock = Lock()
        self.blocks = 0
        self.pixels: dict[_Key, np.ndarray] = {}
        self.turns: dict[_Key, Lock] = {}  # who holds one decodes the file, or copies its pixels
        self.bytes = 0


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
                _kept.turns.clear()
                _kept.bytes = 0


def decoded(path: Path, read: Callable[[Path], np.ndarray]) -> np.ndarray:
    """Return the pixels of a file, from memory if it was decoded before; the caller may change them.

    Args:
        path: the file; one that changed since is read again.
        read: decodes it, or raises what is to be said about it.
    """
    try:
        found = path.stat()
    except OSError:  # not there, as `read` will say
        return read(path)
    if not _kept.blocks:
        return read(path)
    key = (str(path), found.st_mtime_ns, found.st_size)
    with _kept.lock:
        turn = _kept.turns.setdefault(key, Lock())
    with turn:
        known = _kept.pixels.get(key)
        if known is not None:
            return known.copy()
        pixels = read(path)
        with _kept.lock:
            if _kept.blocks and _kept.bytes + pixels.nbytes <= MEMORY:
                _kept.pixels[key] = pixels.copy()
                _kept.bytes += pixels.nbytes
        return pixels
