"""How an error grows with the sensor's noise; assertions on it show the whole curve."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

BAR_WIDTH = 40  # characters


@dataclass(frozen=True)
class DegradationCurve:
    """Errors of one function, measured at rising noise.

    Attributes:
        strengths: factors on the sensor's errors, rising, >= 0.
        errors: at these strengths, in the caller's unit; smaller is better.
    """

    strengths: tuple[float, ...]
    errors: tuple[float, ...]

    def assert_at_most(self, limits: Mapping[float, float]) -> None:
        """Check the errors at some strengths against limits.

        Args:
            limits: largest allowed error by strength; other strengths are not checked.

        Raises:
            AssertionError: an error is larger, or not a number; the message shows the curve.
            KeyError: a strength that was not measured.
        """
        by_strength = dict(zip(self.strengths, self.errors, strict=True))
        too_large = [s for s, limit in limits.items() if not by_strength[s] <= limit]
        if too_large:
            where = ", ".join(f"{s:g} (limit {limits[s]:.4g})" for s in too_large)
            raise AssertionError(f"error too large at noise strength {where}\n{self}")

    def assert_no_cliff(self, largest_growth: float = 2.0) -> None:
        """Check that the error never grows much faster than the noise.

        Args:
            largest_growth: largest allowed exponent; 1: twice the noise, twice the error; 2: four times
                the error. Averages and fits stay near 1 until outliers dominate.

        Raises:
            AssertionError: a steeper piece, or an error that is not a number; the message shows the curve.
        """
        if not all(math.isfinite(error) for error in self.errors):
            raise AssertionError(f"some errors are no numbers\n{self}")
        steep = [
            f"from strength {low:g} to {high:g} it grows with exponent {growth:.2f}"
            for low, high, growth in self.growth()
            if growth > largest_growth
        ]
        if steep:
            raise AssertionError(
                f"the error falls off a cliff: {'; '.join(steep)} (limit {largest_growth:g})\n{self}"
            )

    def growth(self) -> list[tuple[float, float, float]]:
        """Return (strength, next strength, exponent) of each piece of the curve above strength 0.

        The exponent is the slope in a plot with logarithmic axes: error ~ strength^exponent.
        """
        points = [p for p in zip(self.strengths, self.errors, strict=True) if p[0] > 0]
        pieces = []
        for (s0, e0), (s1, e1) in pairwise(points):
            if e0 > 0 and e1 > 0:
                exponent = math.log(e1 / e0) / math.log(s1 / s0)
            else:
                exponent = math.inf if e1 > e0 else 0.0
            pieces.append((s0, s1, exponent))
        return pieces

    def __str__(self) -> str:
        """A table with a bar per strength."""
        finite = [error for error in self.errors if math.isfinite(error)]
        largest = max(finite, default=0.0)
        lines = ["strength        error"]
        for strength, error in zip(self.strengths, self.errors, strict=True):
            share = error / largest if math.isfinite(error) and largest > 0 else 0.0
            bar = "#" * round(BAR_WIDTH * max(share, 0.0))
            lines.append(f"{strength:8g} {error:12.5g} {bar}".rstrip())
        return "\n".join(lines)
