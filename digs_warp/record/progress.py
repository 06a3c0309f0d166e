"""Progress bars with a time estimate."""

import sys
from typing import Any

from tqdm import tqdm

# Library calls are silent; the command line turns the bars on.
_show_progress = False


def show_progress(shown: bool = True) -> None:
    """Turn progress bars on stderr on or off for the whole process."""
    global _show_progress
    _show_progress = shown


def progress(total: int, label: str, unit: str = "it", initial: int = 0) -> "tqdm[Any]":
    """Return a progress bar with a time estimate; use it as a context manager and `update` it."""
    interactive = sys.stderr.isatty()
    return tqdm(
        total=total,
        initial=initial,
        desc=label,
        unit=unit,
        disable=not _show_progress,
        # In a log file every refresh is a line: a few are enough, and a bar inside another moves no cursor.
        mininterval=0.2 if interactive else 15.0,
        position=None if interactive else 0,
        ascii=not interactive,
        dynamic_ncols=interactive,
    )
