"""How an error grows with the sensor's noise: assertions, and the whole curve."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

from digs_warp.checks import DigsError
from digs_warp.record.fields import shown

BAR_WIDTH = 40  # characters

# What noise adds to an error grows at least with this exponent; the fourth root is already very slow.
SMALLEST_GROWTH = 0.25
# An error at more noise is at least this fraction of one at less noise; chance changes it by less.
LARGEST_FALL = 0.5


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
            DigsError: a strength that was not measured.
        """
        __tracebackhide__ = True  # pytest shows the line of the test
        by_strength = dict(zip(self.strengths, self.errors, strict=True))
        if unknown := [strength for strength in limits if strength not in by_strength]:
            raise DigsError(
                f"assert_at_most: strength {unknown[0]:g} was not measured, expected some of "
                f"{shown(self.strengths)}; the marker's 'strengths' choose them"
            )
        too_large = [s for s, limit in limits.items() if not by_strength[s] <= limit]
        if too_large:
            where = ", ".join(f"{s:g} (limit {limits[s]:.4g})" for s in too_large)
            what = (
                "is too large"
                if all(math.isfinite(by_strength[s]) for s in too_large)
                else "is no number"
            )
            raise AssertionError(f"the error {what} at noise strength {where}\n{self}")

    def assert_no_cliff(
        self, largest_growth: float = 2.0, smallest_growth: float = SMALLEST_GROWTH
    ) -> None:
        """Check that the error grows with the noise, and never much faster.

        Args:
            largest_growth: largest allowed exponent; 1: twice the noise, twice the error; 2: four times
                the error. Averages and fits stay near 1 until outliers dominate.
            smallest_growth: an error that more than doubles from strength 0 to the next one has to grow
                further with at least this exponent; 0 allows a jump to a constant.

        Raises:
            AssertionError: a steeper piece, a jump as soon as there is noise, an error that falls to less
                than half of an earlier one, or an error that is not a number; the message shows the curve.
            DigsError: fewer than two strengths above 0, which show no growth.
        """
        __tracebackhide__ = True
        if sum(strength > 0 for strength in self.strengths) < 2:
            raise DigsError(
                f"assert_no_cliff: strengths {shown(self.strengths)}, expected two above 0 or more"
            )
        if not all(math.isfinite(error) for error in self.errors):
            raise AssertionError(f"some errors are no numbers\n{self}")
        if fall := self._fall():  # first, for an error that falls is steep where it comes back
            raise AssertionError(f"{fall}\n{self}")
        steep = [
            f"from strength {low:g} to {high:g} it grows with exponent {growth:.2f}"
            for low, high, growth in self.growth()
            if growth > largest_growth
        ]
        if steep:
            raise AssertionError(
                f"the error falls off a cliff: {'; '.join(steep)} (limit {largest_growth:g})\n{self}"
            )
        if jump := self._jump(smallest_growth):
            raise AssertionError(f"{jump}\n{self}")

    def _jump(self, smallest_growth: float) -> str:
        """Describe an error that appears with the first noise and then hardly grows; "" if it does not."""
        if self.strengths[0] > 0:
            return ""
        base, first, last = self.errors[0], self.errors[1], self.errors[-1]
        if first - base <= max(base, 0.0):
            return ""
        s1, s2 = self.strengths[1], self.strengths[-1]
        growth = (
            math.log((last - base) / (first - base)) / math.log(s2 / s1)
            if last > base
            else -math.inf
        )
        if growth >= smallest_growth:
            return ""
        return (
            f"the error jumps from strength 0 to {s1:g}; what the noise adds then grows only with exponent "
            f"{growth:.2f} (limit {smallest_growth:g}). What a stereo camera cannot see, such as places that "
            "only one eye sees, is the same at all strengths above 0: if that is the reason, allow it with "
            "smallest_growth=0"
        )

    def _fall(self) -> str:
        """Describe the first fall to less than half of an earlier error; "" if there is none."""
        highest, at = self.errors[0], self.strengths[0]
        for strength, error in zip(self.strengths, self.errors, strict=True):
            if error < LARGEST_FALL * highest:
                return (
                    f"the error falls while the noise rises, from strength {at:g} to {strength:g}: it "
                    "measures something else, or leaves out what is bad. If another seed changes that, it is "
                    "chance: more or larger frames make it settle"
                )
            if error > highest:
                highest, at = error, strength
        return ""

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

    def to_json(self) -> dict[str, list[float]]:
        """Return the curve as lists."""
        return {"strengths": list(self.strengths), "errors": list(self.errors)}

    def __str__(self) -> str:
        """A table with a bar per strength."""
        largest = max((error for error in self.errors if math.isfinite(error)), default=0.0)
        lines = ["strength        error"]
        for strength, error in zip(self.strengths, self.errors, strict=True):
            is_shown = math.isfinite(error) and largest > 0
            bar = "#" * (round(BAR_WIDTH * error / largest) if is_shown else 0)
            lines.append(f"{strength:8g} {error:12.5g} {bar}".rstrip())
        return "\n".join(lines)
