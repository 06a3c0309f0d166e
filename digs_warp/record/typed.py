"""Dataclasses as JSON values and back, by the annotations of their fields.

    @dataclass(frozen=True)
    class Shot:
        name: str
        exposure_time: Annotated[float, Expect("seconds, 0 or more", lambda value: value >= 0)] = 0.0
        camera: Camera | None = None

    from_json(Shot, {"name": "a", "exposure_time": -1}, "'shots.json'")
    # DigsError: 'shots.json': exposure_time is -1, expected seconds, 0 or more

Fields are numbers, texts, paths, choices (`Literal`), dataclasses, and tuples, dictionaries and unions of
these. A None that is the field's default is left out; NaN is null. Reading, null in a field that cannot be
None counts as missing. Two marks of a dataclass change what is written:

- a field annotated with `NOT_STORED` is neither written nor read;
- the class attribute ``DERIVED`` names properties that are written, for readers of the file, and not read.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from functools import cache
from math import isnan
from pathlib import Path
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    Final,
    Literal,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from digs_warp.checks import DigsError
from digs_warp.record.fields import MOST_DIGITS, is_number, is_text, shown
from digs_warp.words import did_you_mean

T = TypeVar("T")

NOT_STORED: Final = "not stored"
"""Annotates a field that is not in the file: another file holds it, or none."""


@dataclass(frozen=True)
class Expect:
    """Annotates a field with what its value has to be, beside its type.

    Attributes:
        what: for messages, such as "metres, 0 or more".
        fits: whether a value of the right type does; default: all do.
    """

    what: str
    fits: Callable[[Any], bool] = lambda value: True


AT_LEAST_0 = Expect("a number, 0 or more", lambda value: value >= 0)
COUNT = Expect("a whole number, 0 or more", lambda value: value >= 0)


def to_json(record: Any) -> dict[str, Any]:
    """Return the values of a dataclass as JSON values, by the names of its fields."""
    values = {each: getattr(record, each.name) for each in _stored(type(record))}
    known = {
        each.name: _plain(value)
        for each, value in values.items()
        if value is not None or each.default is not None
    }
    return known | {name: getattr(record, name) for name in getattr(record, "DERIVED", ())}


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return to_json(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(each) for each in value]
    if isinstance(value, float) and isnan(value):
        return None
    return str(value) if isinstance(value, Path) else value


def from_json(
    kind: type[T],
    values: Any,
    where: str,
    *,
    error: type[DigsError] = DigsError,
    remedy: str = "",
    strict: bool = False,
    **known: Any,
) -> T:
    """Return the dataclass that `to_json` wrote; missing fields keep their defaults.

    Args:
        kind: the dataclass.
        values: the JSON object.
        where: the file, and the place in it, for messages.
        error: what is raised.
        remedy: what to do about a broken file; the end of messages.
        strict: refuse names that are no field; else they are ignored.
        known: values of fields that are not in the file.

    Raises:
        DigsError: a value has the wrong type or is out of range, or one without a default is missing; the
            message names the file and the field.
    """
    try:
        return _record(kind, values, where, strict, known)
    except DigsError as found:
        raise error(f"{found}{remedy and '; ' + remedy}") from found.__cause__


def _record(kind: Any, values: Any, where: str, strict: bool, known: Mapping[str, Any]) -> Any:
    if not isinstance(values, Mapping):
        raise DigsError(f"{where}: expected a JSON object, found {shown(values)}")
    names = [each.name for each in _stored(kind)]
    if strict and (unknown := [str(key) for key in values if key not in names]):
        raise DigsError(f"{where}: unknown setting '{unknown[0]}'{did_you_mean(unknown[0], names)}")
    found = dict(known)
    for each in _stored(kind):
        name, hint = each.name, _hints(kind)[each.name]
        is_given = name in values and (strict or values[name] is not None or _takes_none(hint))
        if is_given:
            found[name] = _value(hint, values[name], name, where, strict)
        elif each.default is MISSING and each.default_factory is MISSING:
            raise DigsError(f"{where}: has no '{name}'")
    return kind(**found)


def _value(hint: Any, value: Any, name: str, where: str, strict: bool, what: str = "") -> Any:
    """Return a JSON value as the type of a field; ``what`` is expected, for messages."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        expected = next((note for note in inner[1:] if isinstance(note, Expect)), Expect(""))
        found = _value(inner[0], value, name, where, strict, expected.what)
        if found is not None and not expected.fits(found):
            raise _wrong(value, name, where, expected.what)
        return found
    if origin in (Union, UnionType):
        return _one_of(inner, value, name, where, strict, what)
    if is_dataclass(hint):
        return _record(hint, value, f"{where}, {name}", strict, {})
    if origin is tuple and isinstance(value, list | tuple):
        hints = [inner[0]] * len(value) if inner[-1] is ... else inner
        if len(hints) == len(value):
            pairs = enumerate(zip(hints, value, strict=True))
            return tuple(_value(h, v, f"{name} {i}", where, strict) for i, (h, v) in pairs)
    if origin in (dict, Mapping) and isinstance(value, Mapping):
        is_int = inner[0] is int
        if not is_int or all(map(_is_code, value)):
            items = {
                k: _value(inner[1], v, k, f"{where}, {name}", strict) for k, v in value.items()
            }
            return {int(k): v for k, v in items.items()} if is_int else items
    if origin is Literal and value in inner:
        return value
    if hint in _PLAIN and _PLAIN[hint][1](value):
        return value if hint is Any else hint(value)
    raise _wrong(value, name, where, what or _words(hint))


def _one_of(
    hints: tuple[Any, ...], value: Any, name: str, where: str, strict: bool, what: str
) -> Any:
    """Return a value as the first of several types that it fits."""
    if value is None and NoneType in hints:
        return None
    options = [each for each in hints if each is not NoneType]
    if len(options) == 1:
        return _value(options[0], value, name, where, strict, what)
    for each in options:
        with suppress(DigsError):
            return _value(each, value, name, where, strict)
    raise _wrong(value, name, where, what or " or ".join(map(_words, options)))


def _wrong(value: Any, name: str, where: str, expected: str) -> DigsError:
    return DigsError(f"{where}: {name} is {shown(value)}, expected {expected}")


def _is_code(key: Any) -> bool:
    """Whether a key stands for a whole number; none that is used has more digits."""
    return str(key).isdecimal() and len(str(key)) < MOST_DIGITS


# Type -> its name in messages, and whether a JSON value is one.
_PLAIN: dict[Any, tuple[str, Callable[[Any], bool]]] = {
    bool: ("true or false", lambda value: isinstance(value, bool)),
    int: ("a whole number", lambda value: is_number(value) and value == int(value)),
    float: ("a finite number", is_number),
    str: ("a text", is_text),
    Path: ("a path", lambda value: is_text(value) or isinstance(value, Path)),
    Any: ("a JSON value", lambda value: True),
}


def _words(hint: Any) -> str:
    """Return a type in the words of messages."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Literal:
        return f"one of {', '.join(map(str, inner))}"
    if origin is tuple:
        return "a list" if inner[-1] is ... else f"a list of {len(inner)}"
    return _PLAIN[hint][0] if hint in _PLAIN else "a JSON object"


@cache
def _stored(kind: Any) -> list[Field[Any]]:
    hints = _hints(kind)
    return [each for each in fields(kind) if NOT_STORED not in get_args(hints[each.name])]


@cache
def _hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind, include_extras=True)


def _takes_none(hint: Any) -> bool:
    if get_origin(hint) is Annotated:
        return _takes_none(get_args(hint)[0])
    return get_origin(hint) in (Union, UnionType) and NoneType in get_args(hint)
