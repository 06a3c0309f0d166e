"""Starts Warp so that it logs only useful messages, through Python's logging.

By default, Warp prints a banner and its compilations to stdout, where results belong. Its native code warns
on stderr if there is no CUDA driver, which is normal here.
"""

import logging
import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import warp as wp

from digs_warp.checks import DigsError

logger = logging.getLogger("digs_warp.kernels")

COMPILED = re.compile(r"Module (?P<module>\S+) .* took (?P<milliseconds>[\d.]+) ms\s+\(compiled\)")
NO_DRIVER = b"Warp CUDA warning: Could not find or load the NVIDIA CUDA driver"


@cache
def start_warp() -> None:
    """Initialize Warp; later calls do nothing."""
    wp.set_logger(_ToLogging())
    with _without_driver_warning():
        wp.init()


def require_device(name: str) -> str:
    """Return ``name``, or raise a `DigsError` when Warp has no such device on this machine."""
    start_warp()
    try:
        wp.get_device(name)
    except (RuntimeError, ValueError):
        there_is = ", ".join(map(str, wp.get_devices()))
        raise DigsError(
            f"--device: '{name}', which Warp does not find on this machine; expected one of {there_is}"
        ) from None
    return name


def compile_seconds() -> float:
    """Return the time [s] that this process has spent compiling kernels so far."""
    return sum(_compiled)


_compiled: list[float] = []  # seconds of each module; appending is atomic


class _ToLogging:
    """Warp's logger interface, forwarded to Python's logging."""

    def debug(self, message: str) -> None:
        logger.debug(message)

    def info(self, message: str) -> None:
        # Compiling takes seconds, once per kernel and machine, so it is worth a line. The rest is not.
        if found := COMPILED.match(message):
            seconds = float(found["milliseconds"]) / 1e3
            _compiled.append(seconds)
            logger.info("compiled %s in %.1f s, once for all runs", found["module"], seconds)
        else:
            logger.debug(message)

    def warning(self, message: str, category: object = None, stacklevel: int = 1) -> None:
        logger.warning(message)

    def error(self, message: str) -> None:
        logger.error(message)


@contextmanager
def _without_driver_warning() -> Iterator[None]:
    """Forward native code's output to stderr, except the line about the missing driver."""
    with tempfile.TemporaryFile() as caught:
        stderr = os.dup(2)
        os.dup2(caught.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
        caught.seek(0)
        for line in caught:
            if not line.startswith(NO_DRIVER):
                os.write(2, line)
