"""Ctrl-C, SIGTERM and SIGHUP: a command ends in order and says how to go on.

Training waits for the end of the current step, so that the saved state is consistent.
"""

import os
import signal
import stat
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

# `kill`, a batch system at the end of its time, or a machine that shuts down; and a terminal that is closed.
STOP_SIGNALS = (signal.SIGTERM, signal.SIGHUP)

_STDOUT, _STDERR = 1, 2


class Stopped(KeyboardInterrupt):
    """SIGTERM or SIGHUP arrived. What handles Ctrl-C handles this, too.

    Attributes:
        number: of the signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


class Interruption:
    """Whether a signal asked the program to end; None: not so far, else its number."""

    def __init__(self) -> None:
        self.asked: int | None = None

    def end(self) -> NoReturn:
        """Interrupt the program, as the signal would have done at once."""
        assert self.asked is not None
        _interrupt(self.asked, None)


@contextmanager
def stopped_by_signals() -> Iterator[None]:
    """Make SIGTERM and SIGHUP raise `Stopped` in the block, as Ctrl-C raises `KeyboardInterrupt`.

    For commands: a library must leave the signals of its process alone. A signal that is ignored stays so
    (``nohup``). Python delivers signals to the main thread only; in other threads this does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {
        number: signal.signal(number, _interrupt)
        for number in STOP_SIGNALS
        if signal.getsignal(number) != signal.SIG_IGN
    }
    try:
        yield
    finally:
        _restore(before)


@contextmanager
def deferred_interrupt() -> Iterator[Interruption]:
    """Note the first Ctrl-C (SIGINT) and let the work continue; a second one interrupts at once.

    The same holds for SIGTERM and SIGHUP within `stopped_by_signals`. Python delivers signals to the main
    thread only; in other threads this does nothing.
    """
    interruption = Interruption()
    if threading.current_thread() is not threading.main_thread():
        yield interruption
        return

    def note(number: int, frame: FrameType | None) -> None:
        if interruption.asked is not None:
            _interrupt(number, frame)
        _leave_dead_terminal()
        interruption.asked = number

    ours = [number for number in STOP_SIGNALS if signal.getsignal(number) is _interrupt]
    before = {number: signal.signal(number, note) for number in (signal.SIGINT, *ours)}
    try:
        yield interruption
    finally:
        _restore(before)


def _restore(handlers: dict[signal.Signals, "signal._HANDLER"]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)


def _interrupt(number: int, frame: FrameType | None) -> NoReturn:
    _leave_dead_terminal()
    raise KeyboardInterrupt if number == signal.SIGINT else Stopped(number)


def _leave_dead_terminal() -> None:
    """Discard further output to a terminal that was closed: writing to it would be an error."""
    for descriptor in (_STDOUT, _STDERR):
        try:
            is_device = stat.S_ISCHR(os.fstat(descriptor).st_mode)
        except OSError:  # closed by whoever started the program
            continue
        if is_device and not os.isatty(descriptor):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, descriptor)
            os.close(nowhere)
