"""Questions to the records of a study: groups, means, spreads."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, stdev
from typing import Any

Record = Mapping[str, Any]


@dataclass(frozen=True)
class Spread:
    """Mean and standard deviation of some values; the deviation of a single one is 0."""

    mean: float
    deviation: float
    count: int

    @staticmethod
    def of(values: Iterable[float]) -> "Spread | None":
        """Return None without values."""
        found = [value for value in values if value is not None]
        if not found:
            return None
        return Spread(fmean(found), stdev(found) if len(found) > 1 else 0.0, len(found))

    def text(self, decimals: int) -> str:
        """Return "mean ± deviation", or the mean alone of a single value."""
        spread = f" ± {self.deviation:.{decimals}f}" if self.count > 1 else ""
        return f"{self.mean:.{decimals}f}{spread}"


def group_by(records: Iterable[Record], *labels: str) -> dict[tuple[Any, ...], list[Record]]:
    """Return the records by the values of some labels, in the order in which they come."""
    groups: dict[tuple[Any, ...], list[Record]] = {}
    for record in records:
        groups.setdefault(tuple(record["labels"].get(label) for label in labels), []).append(record)
    return groups


def spread(records: Sequence[Record], value: Callable[[Record], float | None]) -> Spread | None:
    """Return mean and deviation of a value over the records that have it."""
    return Spread.of(v for record in records if (v := value(record)) is not None)


def at_iteration(record: Record, iteration: int, metric: str) -> float | None:
    """Return a metric of the held-out views at an iteration, or None when it was not measured then."""
    for line in record["course"]:
        if line["iteration"] == iteration:
            return line.get(metric)
    return None


def seconds_to_quality(record: Record, psnr: float) -> float | None:
    """Return the training seconds after which the held-out PSNR [dB] was first measured that high."""
    return next((line["seconds"] for line in record["course"] if line["psnr"] >= psnr), None)


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Return the indices, by cost, of those (cost, gain) points that no other beats in both.

    Of equal points the first counts.
    """
    front: list[int] = []
    for index in sorted(range(len(points)), key=lambda i: (points[i][0], -points[i][1], i)):
        if not front or points[index][1] > points[front[-1]][1]:
            front.append(index)
    return front
