"""Results as fields of dataclasses: one field is one result of run.json, `digs-warp info` and the report."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args, get_type_hints


@dataclass(frozen=True)
class Figure:
    """How a result is shown, in the annotation of its field.

    Attributes:
        label: its name in `digs-warp info` and in the report.
        unit: in which a number is shown.
        digits: after the decimal point.
        factor: from the stored number to the shown one, such as 1000 from metres to millimetres.
    """

    label: str
    unit: str = ""
    digits: int = 2
    factor: float = 1.0

    def words(self, value: Any) -> str:
        """Return a value in words; empty where there is nothing to say."""
        if isinstance(value, float):
            return f"{value * self.factor:,.{self.digits}f} {self.unit}".rstrip()
        if isinstance(value, int):
            return f"{value:,} {self.unit}".rstrip()
        if isinstance(value, Mapping):
            return ", ".join(f"{name} {count:,}" for name, count in value.items())
        return " ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def figures(record: Any) -> dict[str, str]:
    """Return the known results of a record that have a `Figure`, in words, in the order of its fields."""
    found = {}
    for name, hint in get_type_hints(type(record), include_extras=True).items():
        value = getattr(record, name)
        shown = [each for each in get_args(hint)[1:] if isinstance(each, Figure)]
        if shown and value is not None and (words := shown[0].words(value)):
            found[shown[0].label] = words
    return found
