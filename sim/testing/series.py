"""One recording at rising sensor noise, and how errors grow with it."""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.record.fields import shown
from digs_warp.sim.testing.cache import CaptureCache
from digs_warp.sim.testing.curve import DegradationCurve
from digs_warp.sim.testing.sources import NoiseSource


@dataclass(frozen=True)
class NoiseSeries:
    """Captures of the same walk around the same object; only the sensor's errors differ.

    Iterating gives (strength, capture) in rising order; captures are made when they are first needed.

    Attributes:
        source: makes them.
        strengths: factors on the sensor's errors; 0: perfect depth, or a recording as it is; 1: errors as
            those of the real sensor.
        cache: keeps the captures.
        on_curve: called with the name of each function that was measured, and its curve.
    """

    source: NoiseSource
    strengths: tuple[float, ...]
    cache: CaptureCache
    on_curve: Callable[[str, DegradationCurve], None] = lambda _name, _curve: None

    def __post_init__(self) -> None:
        check_strengths(self.strengths)

    def __iter__(self) -> Iterator[tuple[float, Capture]]:
        return ((strength, self.capture(strength)) for strength in self.strengths)

    def capture(self, strength: float) -> Capture:
        """Return the capture at one strength."""
        return self.cache.capture(self.source, strength)

    def measure(self, error: Callable[[Capture], float]) -> DegradationCurve:
        """Return how ``error(capture)`` grows with the noise; smaller is better."""
        errors = []
        for strength, capture in self:
            try:
                errors.append(_number(error(capture)))
            except Exception as failure:
                failure.add_note(f"on the capture at sensor noise strength {strength:g}")
                raise
        curve = DegradationCurve(self.strengths, tuple(errors))
        self.on_curve(getattr(error, "__name__", type(error).__name__), curve)
        return curve


def _number(found: object) -> float:
    try:
        return float(found)  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError):
        raise DigsError(
            f"measure: the function returned {shown(found)}, expected one number: its error"
        ) from None


def check_strengths(strengths: Iterable[float]) -> tuple[float, ...]:
    """Return the strengths, or raise a `DigsError` when they do not rise from 0 or above."""
    found = tuple(strengths) if isinstance(strengths, Iterable) else (strengths,)
    if not all(isinstance(each, int | float) and math.isfinite(each) for each in found):
        raise DigsError(f"strengths {shown(found)}: expected finite numbers")
    if not found or found[0] < 0 or not all(a < b for a, b in pairwise(found)):
        raise DigsError(f"strengths {shown(found)}: expected rising numbers, the first >= 0")
    return found
