"""Run one Warp launch on all CPU cores.

Warp runs a CPU launch as one serial loop on the calling thread. `ParallelLaunch` splits the index range
into chunks and records one launch per chunk; a few threads replay them, while ``ctypes`` releases the
interpreter lock. Kernels must write to disjoint addresses per index (``wp.atomic_add`` is a plain ``+=`` on
a CPU) and take the chunk's first index as their first argument. Then the result does not depend on the
number of threads.
"""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from functools import cache
from threading import Lock
from typing import Any

import numpy as np
import warp as wp

from digs_warp.device.threads import default_threads
from digs_warp.device.warp_start import start_warp


def put(array: wp.array, values: np.ndarray | tuple[float, ...]) -> None:
    """Set all values of a small contiguous array.

    A step of the training sets a dozen, and the arrays that `wp.array.assign` makes each time take longer
    than the rest of it.
    """
    if str(array.device) == "cpu":
        array.numpy()[...] = values
        return
    with _copying:
        on_host, written = _kept_on_host(array.dtype, array.shape)
        written[...] = values
        wp.copy(array, on_host)  # has read it when it returns, for this memory is not pinned


_copying = Lock()


@cache
def _kept_on_host(dtype: Any, shape: tuple[int, ...]) -> tuple[wp.array, np.ndarray]:
    """Return an array on the host, and its memory as NumPy sees it."""
    array = wp.zeros(shape, dtype=dtype, device="cpu")
    return array, array.numpy()


start_warp()

# More chunks than threads, to balance uneven chunks and delayed threads; a launch costs about 5 us.
CHUNKS_PER_THREAD = 8
EVEN_CHUNKS_PER_THREAD = 3

_recording = Lock()


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="warp")


def _start_anew() -> None:
    """Forget the threads, of which a forked process has none, and the locks that they may have held."""
    global _recording, _copying
    _pool.cache_clear()
    _recording, _copying = Lock(), Lock()


if hasattr(os, "register_at_fork"):  # a data loader of PyTorch forks its workers
    os.register_at_fork(after_in_child=_start_anew)


def recorded(kernel: Any, dim: int, inputs: list[Any], device: str = "cpu") -> Any:
    """Return a launch of ``kernel`` over indices 0..dim-1, whose ``launch`` runs it on the calling thread.

    It holds raw addresses: keep the arrays in ``inputs`` alive. Any thread may call this: recording loads the
    kernel's module, and of two threads that load it together each would get a copy, the first of which is
    freed while it runs.
    """
    with _recording:
        return wp.launch(kernel, dim=dim, inputs=inputs, device=device, record_cmd=True)


def launch_here(kernel: Any, dim: int, inputs: list[Any]) -> None:
    """Run ``kernel`` once over indices 0..dim-1 on the calling thread, one of several that are at work."""
    recorded(kernel, dim, inputs).launch()


def _part(whole: Any, first: int, count: int) -> Any:
    """Return a copy of a recorded launch for some of its indices; recording anew takes longer."""
    part = copy(whole)
    part.params = list(whole.params)
    part.set_dim(count)
    part.set_param_at_index(0, first)
    return part


class ParallelLaunch:
    """A recorded launch of ``kernel`` over indices 0..dim-1, split over CPU threads.

    The kernel's first parameter is the first index of a chunk (int); ``inputs`` are the others. On a CUDA
    device it is a single launch. Array arguments are bound when recorded: call `run` again after changing
    their contents, and build a new object after replacing them. ``even`` says that all indices take about
    the same time, so fewer chunks are enough.
    """

    def __init__(
        self,
        kernel: Any,
        dim: int,
        inputs: list[Any],
        device: str = "cpu",
        threads: int = 0,
        even: bool = False,
    ) -> None:
        self.threads = (threads or default_threads()) if device == "cpu" else 1
        per_thread = EVEN_CHUNKS_PER_THREAD if even else CHUNKS_PER_THREAD
        pieces = self.threads * per_thread if device == "cpu" and self.threads > 1 else 1
        size = max(1, -(-dim // pieces))
        self._inputs = list(inputs)  # keeps the arrays alive: a recorded launch holds raw addresses
        self.chunks: list[Any] = [recorded(kernel, dim, [0, *inputs], device)] if dim > 0 else []
        if size < dim:
            firsts = range(0, dim, size)
            self.chunks = [_part(self.chunks[0], i, min(size, dim - i)) for i in firsts]

    def set_param(self, index: int, value: Any) -> None:
        """Change argument ``index`` of ``inputs`` for the next runs; an unchanged number or array is free."""
        before = self._inputs[index]
        if isinstance(value, (int, float)) and value == before:
            return
        if isinstance(value, wp.array) and value is before:
            return
        self._inputs[index] = value
        for launch in self.chunks:
            launch.set_param_at_index(index + 1, value)

    def run(self) -> None:
        """Execute and wait."""
        run_together([self])


def values_per_thread(device: str, block: int) -> int:
    """Return how many neighbors one thread takes: ``block`` on a CPU; on a GPU 1, side by side in memory."""
    return block if device == "cpu" else 1


def run_together(launches: Sequence[ParallelLaunch]) -> None:
    """Execute independent launches and wait; the threads are woken only once."""
    chunks = [chunk for launch in launches for chunk in launch.chunks]
    threads = min(len(chunks), max((launch.threads for launch in launches), default=1))
    queue = iter(chunks)  # taking the next item is atomic: the threads share it

    def work() -> None:
        for chunk in queue:
            chunk.launch()

    # The calling thread works, too. result() re-raises an exception of a chunk.
    others = [_pool(threads - 1).submit(work) for _ in range(threads - 1)]
    work()
    for other in others:
        other.result()


def packed(struct: Any, **fields: Any) -> Any:
    """Return an instance of a `wp.struct` for a launch; it keeps the arrays in it alive.

    A launch copies the struct when it is recorded: record again after replacing an array in it.
    """
    instance = struct()
    for name, value in fields.items():
        setattr(instance, name, value)
    return instance


def launch_parallel(
    kernel: Any, dim: int, inputs: list[Any], device: str = "cpu", threads: int = 0
) -> None:
    """Run ``kernel`` once over indices 0..dim-1 on all cores; see `ParallelLaunch`."""
    if dim > 0:
        ParallelLaunch(kernel, dim, inputs, device, threads).run()
