"""Results as fields of dataclasses: one field is one result of run.json, `digs-warp info` and the report."""

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from math import isnan
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from digs_warp.record.fields import Fields

T = TypeVar("T")


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


# In an annotation: run.json does not hold the field, another file does.
ELSEWHERE = "elsewhere"


def figures(record: Any) -> dict[str, str]:
    """Return the known results of a record that have a `Figure`, in words, in the order of its fields."""
    found = {}
    for name, hint in get_type_hints(type(record), include_extras=True).items():
        value = getattr(record, name)
        shown = [each for each in get_args(hint)[1:] if isinstance(each, Figure)]
        if shown and value is not None and (words := shown[0].words(value)):
            found[shown[0].label] = words
    return found


def to_json(value: Any) -> Any:
    """Return a record, or a value in one, as JSON values; what is not known is left out, NaN is null."""
    if is_dataclass(value):
        found = {name: getattr(value, name) for name in _stored(value)}
        return {name: to_json(each) for name, each in found.items() if each is not None}
    if isinstance(value, Mapping):
        return {name: to_json(each) for name, each in value.items()}
    if isinstance(value, tuple):
        return [to_json(each) for each in value]
    if isinstance(value, float) and isnan(value):
        return None
    return str(value) if isinstance(value, Path) else value


def from_json(kind: type[T], found: Fields, **known: Any) -> T:
    """Return the record that `to_json` wrote, with ``known`` values of other files; other names are ignored.

    Raises:
        DigsError: a value has another type, or one without a default is missing; the message names it.
    """
    hints, needed = _stored(kind), _needed(kind)
    names = [name for name in hints if name in found or name in needed]
    return kind(**{name: _read(hints[name], name, found) for name in names}, **known)


def _stored(record: Any) -> dict[str, Any]:
    """Return the types of the fields that run.json holds, by their names."""
    kind = record if isinstance(record, type) else type(record)
    hints = get_type_hints(kind, include_extras=True)
    stored = [name for name, hint in hints.items() if ELSEWHERE not in get_args(hint)]
    plain = get_type_hints(kind)
    return {name: plain[name] for name in stored}


def _needed(kind: Any) -> set[str]:
    return {
        each.name
        for each in fields(kind)
        if each.default is MISSING and each.default_factory is MISSING
    }


def _read(hint: Any, name: str, found: Fields) -> Any:
    """Return a value of the type that a field is annotated with."""
    kind, types = get_origin(hint), get_args(hint)
    if kind in (Union, UnionType):
        if NoneType in types and name not in found:
            return None
        hint = next(each for each in types if each is not NoneType)
        kind, types = get_origin(hint), get_args(hint)
    if is_dataclass(hint):
        return from_json(hint, found.section(name))  # pyright: ignore[reportArgumentType]
    if kind is dict:
        inside = found.section(name)
        return {key: _read(types[1], key, inside) for key in inside.values}
    if kind is tuple and types[0] is str:
        return found.texts(name)
    if kind is tuple:
        return tuple(found.array(name, (-1,)).tolist())
    if kind is Literal:
        return found.choice(name, types)
    readers = {int: found.whole, float: found.number, bool: found.flag, str: found.text}
    return readers[hint](name)
