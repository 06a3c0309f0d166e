"""Queries on the records of a study: groups, means, tables and curves."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, stdev
from typing import Any

from digs_warp.study.charts import Curve
from digs_warp.study.table import Table

Record = Mapping[str, Any]
Groups = Mapping[tuple[Any, ...], Sequence[Record]]
Value = Callable[[Record], float | None]


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
        spread = f" ± {self.deviation:,.{decimals}f}" if self.count > 1 else ""
        return f"{self.mean:,.{decimals}f}{spread}"


def group_by(records: Iterable[Record], *labels: str) -> dict[tuple[Any, ...], list[Record]]:
    """Return the records by the values of some labels, in the order in which they come."""
    groups: dict[tuple[Any, ...], list[Record]] = {}
    for record in records:
        groups.setdefault(tuple(record["labels"].get(label) for label in labels), []).append(record)
    return groups


def spread(records: Sequence[Record], value: Value) -> Spread | None:
    """Return mean and deviation of a value over the records that have it."""
    return Spread.of(v for record in records if (v := value(record)) is not None)


def number(*path: str, factor: float = 1.0) -> Value:
    """Return what reads a number from nested records, None where a record does not have it."""

    def value(record: Record) -> float | None:
        found: Any = record
        for name in path:
            found = found.get(name) if found else None
        return None if found is None else factor * found

    return value


def at_iteration(iteration: int, metric: str) -> Value:
    """Return what reads a metric of the held-out views at an iteration, None where it was not measured."""

    def value(record: Record) -> float | None:
        lines = (line for line in record["course"] if line["iteration"] == iteration)
        return next(lines, {}).get(metric)

    return value


# PSNR on the object [dB] in views of a perfect camera, the same for all recordings of an object: after one
# brightness and white balance of all views, which automatic exposure leaves open, and one rigid motion, which
# found poses leave open.
final_psnr = number("yardstick", "psnr_object_in_place")
# The same in an image of twice the size, as from half the distance, and what tables call it; records that are
# older than the four sizes do not have it.
AT_TWICE = "at twice the size"
double_psnr = number("yardstick", "psnr_object_in_place_double")


@dataclass(frozen=True)
class Column:
    """A column of numbers over groups of records.

    Attributes:
        heading: above it, with the unit.
        decimals: of its values.
        value: of a record; None where it was not measured.
    """

    heading: str
    decimals: int
    value: Value

    def text(self, records: Sequence[Record]) -> str:
        """Return the cell of a group; empty where nothing was measured."""
        found = spread(records, self.value)
        return found.text(self.decimals) if found else ""


def tabulate(name: str, labels: Sequence[str], groups: Groups, columns: Sequence[Column]) -> Table:
    """Return a table with a row per group: its labels, then the columns."""
    rows = [
        [
            *(f"{label:g}" if isinstance(label, float) else str(label) for label in key),
            *(column.text(records) for column in columns),
        ]
        for key, records in groups.items()
    ]
    return Table(name, [*labels, *(column.heading for column in columns)], rows)


def curve(label: str, points: Mapping[float, Sequence[Record]], value: Value) -> Curve:
    """Return the means of a value of the records at each x; where nothing was measured there is no point."""
    means = {x: found.mean for x, records in points.items() if (found := spread(records, value))}
    return Curve(label, list(means), list(means.values()))


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Return the indices, by cost, of those (cost, gain) points that no other beats in both.

    Of equal points the first counts.
    """
    front: list[int] = []
    for index in sorted(range(len(points)), key=lambda i: (points[i][0], -points[i][1], i)):
        if not front or points[index][1] > points[front[-1]][1]:
            front.append(index)
    return front
