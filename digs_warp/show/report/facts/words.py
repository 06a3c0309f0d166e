"""Lengths, sizes and times in the words of the facts."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from digs_warp.record.run_log import RunRecord

# What is known of a file or folder: names and values, the most important first.
Facts = dict[str, str]

# The sides of what is smaller are told in millimetres [m].
SMALL = 0.1


def record_facts(folder: Path) -> Facts:
    """Stage times of the command that wrote a folder."""
    record = RunRecord.find(folder)
    return seconds_facts(record) if record else {}


def seconds_facts(record: RunRecord) -> Facts:
    """Stage times of a record; nothing where it has none."""
    seconds = ", ".join(f"{name} {value:.1f}" for name, value in record.seconds.items())
    return {"seconds": seconds} if seconds else {}


def extent_words(points: np.ndarray, unit: str = "m") -> str:
    """The sides of the box around points, shape (n, 3), n > 0."""
    return sides_words(points.max(axis=0) - points.min(axis=0), unit)


def sides_words(size: Iterable[float], unit: str = "m") -> str:
    """The sides of a box, in ``unit``; what is smaller than a hand, in millimetres."""
    sides = [float(value) for value in size]
    if unit == "m" and max(sides) < SMALL:
        return " x ".join(f"{1e3 * value:.3g}" for value in sides) + " mm"
    return " x ".join(f"{value:.3f}" for value in sides) + f" {unit}"


def megabytes(path: Path) -> str:
    """The size of a file."""
    return f"{path.stat().st_size / 1e6:.1f} MB"
