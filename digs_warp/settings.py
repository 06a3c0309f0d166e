"""Settings as dataclasses: each states its range where it is declared, and whether it has a flag.

    @dataclass(frozen=True, kw_only=True)
    class Picture(Settings):
        width: Annotated[int, SIDE] = 640
        gamma: Annotated[float | None, Range(0.1, 10), NO_FLAG] = None

`Picture(width=0)` raises "--width: 0, expected 1 to 8,192", on the command line, in a settings file, and in
Python.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, Final

from digs_warp.bounds import GAUSSIANS
from digs_warp.checks import DigsError


@dataclass(frozen=True)
class Range:
    """The values that a number may have, ends included; far beyond what makes sense, within what ends.

    In an annotation of a tuple it holds for each of its numbers.

    Attributes:
        low: the smallest.
        high: the largest.
        unit: of both, for the message; empty: none.
    """

    low: float
    high: float
    unit: str = ""

    def check(self, name: str, value: float | None) -> None:
        """Raise a `DigsError` when a value is not in the range; None passes."""
        if value is not None and not self.low <= value <= self.high:  # NaN is not
            ends = f"{self.low:,.10g} to {self.high:,.10g}"
            raise DigsError(f"{name}: {value!r}, expected {ends} {self.unit}".rstrip())


MANY = 1_000_000.0
WEIGHT = Range(0, MANY)
LEARNING_RATE = Range(1e-12, 1000)
SEED = Range(0, 2**31 - 1)
# Gaussians and points on the way to them.
SPLATS = Range(1, GAUSSIANS.most)
# A picture of 8192 x 8192 pixels takes several gigabytes while it is made.
SIDE = Range(1, 8192)
FRAMES = Range(1, 100_000)
FRAME_RATE = Range(0.01, 1000)
FIELD_OF_VIEW = Range(0.1, 179)
ANGLE = Range(-360, 360)
# From a thousandth of a millimetre.
VOXEL = Range(1e-6, 100)
ITERATIONS = Range(0, 10_000_000)
# Up to a year: no machine is lent for longer.
SECONDS = Range(1e-9, 366 * 86_400)
# Holding out every view would leave none to train on.
TEST_EVERY = Range(2, 1_000_000)

NO_FLAG: Final = "no flag"
"""Annotates a setting that only a settings file (``--config``) and Python set."""


class Settings:
    """Base of dataclasses with numbers: makes each keep the range in its annotation.

    A subclass with a ``__post_init__`` of its own calls that of this class.
    """

    def __post_init__(self) -> None:
        for name, (shown, limits) in _ranges(type(self)).items():
            value = getattr(self, name)
            for each in value if isinstance(value, tuple) else (value,):
                limits.check(shown, each)


@cache
def _ranges(kind: Any) -> Mapping[str, tuple[str, Range]]:
    """Return the name in messages and the range of each field of a dataclass that has one."""
    found = {}
    for field in fields(kind):
        notes = getattr(field.type, "__metadata__", ())
        limits = next((note for note in notes if isinstance(note, Range)), None)
        if limits is not None:
            names = [note.name for note in notes if getattr(note, "name", None)]
            flag = f"--{(names[0] if names else field.name).replace('_', '-')}"
            found[field.name] = (field.name if NO_FLAG in notes else flag, limits)
    return found
