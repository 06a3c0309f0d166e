"""Starts Warp so that it says only what a user can use, through Python's logging.

Left alone, Warp prints a banner and its compilations to stdout, where results belong, and its native part
warns on stderr whenever there is no CUDA driver: the usual case here.
"""

import logging
import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import warp as wp

logger = logging.getLogger("digs_warp.kernels")

COMPILED = re.compile(r"Module (?P<module>\S+) .* took (?P<milliseconds>[\d.]+) ms\s+\(compiled\)")
NO_DRIVER = b"Warp CUDA warning: Could not find or load the NVIDIA CUDA driver"


@cache
def start_warp() -> None:
    """Initialize Warp; later calls do nothing."""
    wp.set_logger(_ToLogging())
    with _without_driver_warning():
        wp.init()


def compile_seconds() -> float:
    """Return the seconds [s] that this process has spent on compiling kernels so far."""
    return sum(_compiled)


_compiled: list[float] = []  # seconds of each module; appending is atomic


class _ToLogging:
    """Warp's logger interface, forwarded."""

    def debug(self, message: str) -> None:
        logger.debug(message)

    def info(self, message: str) -> None:
        # Compiling takes seconds and happens once per kernel and machine: worth a line. The rest is not.
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
    """Pass on what native code writes to stderr, but for the line about the missing driver."""
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
