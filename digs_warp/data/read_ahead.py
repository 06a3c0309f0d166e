"""Decodes the frames of a recording while the program loads its libraries and looks at the first frames.

Importing takes half a second of one core, decoding 60 frames of 640x360 as much of another one.

A decoder needs no interpreter, but between two files the reader does, and who imports gives it away every
5 ms only: the reader would wait most of the time.
"""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Lock, Thread

from digs_warp.checks import DigsError
from digs_warp.data.decoded import kept_for_later, room_left
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer

# What a reconstruction reads first of every frame.
_LAYERS = {
    Layer.IMAGE: Frame.load_image,
    Layer.DEPTH: Frame.load_depth,
    Layer.MASK: Frame.load_mask,
}

# For how long one thread keeps the interpreter while another one waits for it [s].
TURN = 0.0002


class _ShortTurns:
    """Turns of `TURN` while at least one thread is within the block: they are those of the whole process."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._users = 0
        self._usual = 0.0

    def __enter__(self) -> None:
        with self._lock:
            if self._users == 0:
                self._usual = sys.getswitchinterval()
                sys.setswitchinterval(TURN)
            self._users += 1

    def __exit__(self, *error: object) -> None:
        with self._lock:
            self._users -= 1
            if self._users == 0:
                sys.setswitchinterval(self._usual)


_SHORT_TURNS = _ShortTurns()


@contextmanager
def reading_ahead(frames: Sequence[Frame]) -> Iterator[None]:
    """Within the block, decode frames beside it, for the next `decoded_once` and as far as its memory goes.

    A file that cannot be read is left to whoever needs it.
    """
    enough = Event()

    def read() -> None:
        with _SHORT_TURNS:
            _read(frames, enough)

    with kept_for_later():
        reader = Thread(target=read, name="read ahead")
        reader.start()
        try:
            yield
        finally:
            enough.set()
            reader.join()


def _read(frames: Sequence[Frame], enough: Event) -> None:
    for frame in frames:
        for layer, load in _LAYERS.items():
            if enough.is_set():
                return
            if isinstance(frame.layers.get(layer), Path):
                with suppress(DigsError, OSError):
                    if load(frame).nbytes > room_left():
                        return
