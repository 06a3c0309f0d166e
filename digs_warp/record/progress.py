"""Progress: a line when a stage begins, and a time estimate in bars on a terminal or lines in a log."""

import logging
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Self

from tqdm import tqdm

logger = logging.getLogger(__name__)

# Shorter stages write no line to a log.
SECONDS_BETWEEN_LINES = 30.0

# Library calls are silent; the command line turns progress on, and its seconds count from then.
_show_progress = False
_start = 0.0
_depth = 0  # of the stages that have begun


def show_progress(shown: bool = True) -> None:
    """Turn progress on stderr on or off for the whole process."""
    global _show_progress, _start
    _show_progress, _start = shown, time.monotonic()


def _is_shown() -> bool:
    return _show_progress and os.environ.get("TQDM_DISABLE", "0") in ("", "0")


@contextmanager
def announced(stage: str) -> Iterator[None]:
    """Log that a stage begins, and how many seconds after the command; those within are indented."""
    global _depth
    if _is_shown():
        logger.info("%6.1f s  %s%s", time.monotonic() - _start, "  " * _depth, stage)
    _depth += 1
    try:
        yield
    finally:
        _depth -= 1


def progress(
    total: int, label: str, unit: str = "step", initial: int = 0
) -> "tqdm[Any] | _LogLines":
    """Return a progress bar, or lines in a log; use it as a context manager and `update` it.

    There are no bars if stderr is not a terminal, and no output at all if TQDM_DISABLE is set.

    Args:
        total: how much there is to do.
        label: what is done, such as "Recording".
        unit: what is counted, in the singular; its plural ends in s.
        initial: how much was done before.
    """
    shown = _is_shown()
    if shown and not sys.stderr.isatty():
        return _LogLines(total, label, unit, initial)
    return tqdm(
        total=total,
        initial=initial,
        desc=label,
        unit=unit,
        disable=not shown,
        mininterval=0.2,
        dynamic_ncols=True,
    )


class _LogLines:
    """Logs the progress of a long stage every half minute."""

    def __init__(self, total: int, label: str, unit: str, initial: int) -> None:
        self.n, self.total = initial, total
        self._initial, self._label, self._postfix = initial, label, ""
        self._unit = unit if total == 1 else f"{unit}s"
        self._start = self._last_line = time.monotonic()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, exc_type: Any, exc_value: Any, traceback: Any, /) -> None:
        pass

    def set_postfix_str(self, s: str, refresh: bool = True) -> None:
        self._postfix = f", {s}" if s else ""

    def update(self, n: int = 1) -> None:
        self.n += n
        now = time.monotonic()
        if now - self._last_line < SECONDS_BETWEEN_LINES or self.n <= self._initial:
            return
        self._last_line = now
        left = (now - self._start) * (self.total - self.n) / (self.n - self._initial)
        logger.info(
            "%s: %d of %d %s, about %.0f s left%s",
            *(self._label, self.n, self.total, self._unit, left, self._postfix),
        )
