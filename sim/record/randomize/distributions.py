"""Distributions of one value. Each turns a share of 0 to 1 into the value below which that share lies.

One uniform number thus decides a draw: the same number gives a similar value after the distribution has been
changed a little, and a quantile of a distribution is its value at that share.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeAlias

Value: TypeAlias = float | int | bool | str | Path | tuple[float, ...] | tuple[str, ...] | None


class Distribution(Protocol):
    """What a setting is drawn from."""

    def at(self, share: float) -> Value:
        """Return the value at a share, 0 <= share < 1."""
        ...

    @property
    def extremes(self) -> tuple[Value, ...]:
        """The values between which all others lie, or all of them: those that have to be allowed."""
        ...

    @property
    def words(self) -> str:
        """The distribution as a file has it."""
        ...


@dataclass(frozen=True)
class Fixed:
    """Always the same value."""

    value: Value

    def at(self, share: float) -> Value:
        """Return the value."""
        return self.value

    @property
    def extremes(self) -> tuple[Value, ...]:
        """The value."""
        return (self.value,)

    @property
    def words(self) -> str:
        """The value."""
        return _word(self.value)


@dataclass(frozen=True)
class Uniform:
    """Every number from ``low`` to ``high`` is as likely as any other."""

    low: float
    high: float

    def at(self, share: float) -> float:
        """Return the number at a share."""
        return self.low + share * (self.high - self.low)

    @property
    def extremes(self) -> tuple[Value, ...]:
        """Both ends."""
        return (self.low, self.high)

    @property
    def words(self) -> str:
        """For example {uniform: [0, 360]}."""
        return f"{{uniform: [{self.low:g}, {self.high:g}]}}"


@dataclass(frozen=True)
class UniformWhole:
    """Every whole number from ``low`` to ``high``, both included, is as likely as any other."""

    low: int
    high: int

    def at(self, share: float) -> int:
        """Return the number at a share."""
        return self.low + min(int(share * (self.high - self.low + 1)), self.high - self.low)

    @property
    def extremes(self) -> tuple[Value, ...]:
        """Both ends."""
        return (self.low, self.high)

    @property
    def words(self) -> str:
        """For example {uniform: [1, 4]}."""
        return f"{{uniform: [{self.low}, {self.high}]}}"


@dataclass(frozen=True)
class LogUniform:
    """Every factor is as likely as any other: [0.5, 2] has its median at 1."""

    low: float
    high: float

    def at(self, share: float) -> float:
        """Return the number at a share."""
        return self.low * (self.high / self.low) ** share

    @property
    def extremes(self) -> tuple[Value, ...]:
        """Both ends."""
        return (self.low, self.high)

    @property
    def words(self) -> str:
        """For example {log_uniform: [0.5, 2]}."""
        return f"{{log_uniform: [{self.low:g}, {self.high:g}]}}"


@dataclass(frozen=True)
class Normal:
    """The bell curve, cut off at limits: what lies beyond is drawn again, not moved to the limit."""

    mean: float
    deviation: float
    low: float
    high: float

    def at(self, share: float) -> float:
        """Return the number at a share."""
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
        """Both limits."""
        return (self.low, self.high)

    @property
    def words(self) -> str:
        """For example {normal: [0, 0.5], limits: [-1, 1]}."""
        limits = f"limits: [{self.low:g}, {self.high:g}]"
        return f"{{normal: [{self.mean:g}, {self.deviation:g}], {limits}}}"


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
    def even(values: tuple[Value, ...]) -> "Choice":
        """Return a choice of values that are all as likely."""
        return Choice(values, (1.0,) * len(values))

    def at(self, share: float) -> Value:
        """Return the value at a share."""
        left = share * math.fsum(self.weights)
        for value, weight in zip(self.values, self.weights, strict=True):
            left -= weight
            if left < 0:
                return value
        return self.values[-1]

    @property
    def extremes(self) -> tuple[Value, ...]:
        """All values."""
        return self.values

    def without(self, value: Value) -> "Choice":
        """Return the choice among the other values; the same one if there are none."""
        left = [(v, w) for v, w in zip(self.values, self.weights, strict=True) if v != value]
        return Choice(*map(tuple, zip(*left, strict=True))) if left else self

    @property
    def words(self) -> str:
        """For example {choice: [d435, oak-d], weights: [2, 1]}."""
        values = f"choice: [{', '.join(map(_word, self.values))}]"
        if len(set(self.weights)) == 1:
            return f"{{{values}}}"
        return f"{{{values}, weights: [{', '.join(f'{weight:g}' for weight in self.weights)}]}}"


def as_json(value: Value) -> Any:
    """Return a value in the form of JSON and YAML."""
    if isinstance(value, tuple):
        return [as_json(each) for each in value]
    return str(value) if isinstance(value, Path) else value


def _word(value: Value) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_word, value))}]"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return f"{value:g}" if isinstance(value, float) else str(value)
