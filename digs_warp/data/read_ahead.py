"""Decodes the frames of a recording while the program loads its libraries and looks at the first frames.

Importing takes half a second of one core, decoding 60 frames of 640x360 as much of another one.

A decoder needs no interpreter, but between two files the reader does, and who imports gives it away every
5 ms only: the reader would wait most of the time.
"""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

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


@contextmanager
def reading_ahead(frames: Sequence[Frame]) -> Iterator[None]:
    """Within the block, decode frames beside it, for the next `decoded_once` and as far as its memory goes.

    A file that cannot be read is left to whoever needs it.
    """
    enough = Event()

    def read() -> None:
        usual = sys.getswitchinterval()
        sys.setswitchinterval(TURN)
        try:
            _read(frames, enough)
        finally:
            sys.setswitchinterval(usual)

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
