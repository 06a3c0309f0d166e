"""Views reduced one after the other, on all cores."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from typing import TypeVar

from digs_warp.data.frame import Frame
from digs_warp.device.parallel import default_threads
from digs_warp.record.progress import progress

T = TypeVar("T")


def in_order(frames: Sequence[Frame], reduce: Callable[[Frame], T]) -> Iterator[T]:
    """Yield ``reduce`` of all frames in order, only the next few ahead: each one holds its pixels."""
    threads = default_threads()
    with (
        ThreadPoolExecutor(threads) as pool,
        progress(len(frames), "Back-projecting", "frame") as bar,
    ):
        waiting = [pool.submit(reduce, frame) for frame in frames[: 2 * threads]]
        for frame in chain(frames[2 * threads :], [None] * len(waiting)):
            yield waiting.pop(0).result()
            bar.update()
            if frame is not None:
                waiting.append(pool.submit(reduce, frame))
