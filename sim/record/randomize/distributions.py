"""Distributions of one value. Each turns a share of 0 to 1 into the value below which that share lies.

One uniform number thus decides a draw: the same number gives a similar value after the distribution has been
changed a little, and a quantile of a distribution is its value at that share.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

Value: TypeAlias = float | int | bool | str | Path | tuple[float, ...] | tuple[str, ...] | None


@dataclass(frozen=True)
class Span:
    """Numbers from ``low`` to ``high``; of two whole numbers, the whole ones, both included.

    Attributes:
        form: "uniform": each number is as likely as any other; "log_uniform": each factor is, so that
            [0.5, 2] has its median at 1.
    """

    low: float
    high: float
    form: Literal["uniform", "log_uniform"] = "uniform"

    def at(self, share: float) -> float:
        """Return the number at a share, 0 <= share < 1."""
        if self.form == "log_uniform":
            return self.low * (self.high / self.low) ** share
        if isinstance(self.low, int):
            return min(self.low + int(share * (self.high - self.low + 1)), self.high)
        return self.low + share * (self.high - self.low)

    @property
    def extremes(self) -> tuple[Value, ...]:
        """Both ends, which have to be allowed."""
        return (self.low, self.high)

    @property
    def words(self) -> str:
        """As a file has it, for example {log_uniform: [0.5, 2]}."""
        return f"{{{self.form}: {_word(self.extremes)}}}"


@dataclass(frozen=True)
class Normal:
    """The bell curve, cut off at limits: what lies beyond is drawn again, not moved to the limit."""

    mean: float
    deviation: float
    low: float
    high: float

    def at(self, share: float) -> float:
        """Return the number at a share, 0 <= share < 1."""
        from scipy.special import ndtr, ndtri

        low, high = ((limit - self.mean) / self.deviation for limit in (self.low, self.high))
        # By symmetry in the lower tail, where the shares keep their digits.
        if low > 0:
            deviations = -ndtri(ndtr(-low) + share * (ndtr(-high) - ndtr(-low)))
        else:
            deviations = ndtri(ndtr(low) + share * (ndtr(high) - ndtr(low)))
        return min(max(self.mean + self.deviation * float(deviations), self.low), self.high)

    @property
    def extremes(self) -> tuple[Value, ...]:
        """Both limits, which have to be allowed."""
        return (self.low, self.high)

    @property
    def words(self) -> str:
        """As a file has it, for example {normal: [0, 0.5], limits: [-1, 1]}."""
        return f"{{normal: {_word((self.mean, self.deviation))}, limits: {_word(self.extremes)}}}"


@dataclass(frozen=True)
class Choice:
    """One of several values.

    Attributes:
        values: one or more.
        weights: how likely each is, in relation to the others; > 0.
    """

    values: tuple[Value, ...]
    weights: tuple[float, ...]

    @staticmethod
    def even(*values: Value) -> "Choice":
        """Return a choice of values that are all as likely; one alone is always chosen."""
        return Choice(values, (1.0,) * len(values))

    def at(self, share: float) -> Value:
        """Return the value at a share, 0 <= share < 1."""
        left = share * math.fsum(self.weights)
        for value, weight in zip(self.values, self.weights, strict=True):
            left -= weight
            if left < 0:
                return value
        return self.values[-1]

    @property
    def extremes(self) -> tuple[Value, ...]:
        """All values, which have to be allowed."""
        return self.values

    def without(self, value: Value) -> "Choice":
        """Return the choice among the other values; the same one if there are none."""
        left = [(v, w) for v, w in zip(self.values, self.weights, strict=True) if v != value]
        return Choice(*map(tuple, zip(*left, strict=True))) if left else self

    @property
    def words(self) -> str:
        """As a file has it, for example {choice: [d435, oak-d], weights: [2, 1]}."""
        if len(self.values) == 1:
            return _word(self.values[0])
        weights = f", weights: {_word(self.weights)}" if len(set(self.weights)) > 1 else ""
        return f"{{choice: {_word(self.values)}{weights}}}"


Distribution: TypeAlias = Span | Normal | Choice


def as_json(value: Value) -> Any:
    """Return a value in the form of JSON and YAML."""
    if isinstance(value, tuple):
        return [as_json(each) for each in value]
    return str(value) if isinstance(value, Path) else value


def _word(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_word, value))}]"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return f"{value:g}" if isinstance(value, float) else str(value)
