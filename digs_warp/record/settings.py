"""Turns the JSON settings of a record back into dataclasses."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from digs_warp.checks import DigsError
from digs_warp.record.fields import shown
from digs_warp.words import did_you_mean

T = TypeVar("T")


def settings_from_json(kind: type[T], values: Any, name: str = "settings") -> T:
    """Return the dataclass that `to_json` wrote; missing fields keep their defaults.

    Args:
        kind: a dataclass of numbers, texts, paths, choices, tuples and dataclasses. Its static method
            ``of_today``, if it has one, gives settings of earlier versions the names of today.
        values: the JSON object.
        name: of the object, for messages.

    Raises:
        DigsError: a name that is not a field, or a value of the wrong type.
    """
    if not isinstance(values, Mapping):
        raise DigsError(f"{name}: expected names with values, found {shown(values)}")
    values = getattr(kind, "of_today", dict)(values)
    hints = get_type_hints(kind)
    known = [field.name for field in fields(kind)]  # pyright: ignore[reportArgumentType]
    if unknown := [key for key in values if key not in known]:
        raise DigsError(
            f"{name}: unknown setting '{unknown[0]}'{did_you_mean(str(unknown[0]), known)}"
        )
    return kind(
        **{key: _value(hints[key], value, f"{name}.{key}") for key, value in values.items()}
    )


def _value(hint: Any, value: Any, name: str) -> Any:
    """Convert a JSON value to the type of a field."""
    if get_origin(hint) in (Union, UnionType):
        options = get_args(hint)
        if value is None and NoneType in options:
            return None
        hint = next(option for option in options if option is not NoneType)
    if is_dataclass(hint):
        return settings_from_json(hint, value, name)  # pyright: ignore[reportArgumentType]
    if get_origin(hint) is tuple and isinstance(value, list):
        return tuple(_value(get_args(hint)[0], item, name) for item in value)
    if get_origin(hint) is Literal and value in get_args(hint):
        return value
    if hint in (float, Path) and not isinstance(value, bool | NoneType):
        try:
            return hint(value)
        except (OverflowError, TypeError, ValueError):
            pass
    if isinstance(hint, type) and type(value) is hint:
        return value
    wanted = ", ".join(map(str, get_args(hint))) or getattr(hint, "__name__", hint)
    raise DigsError(f"{name}: {shown(value)}, expected {wanted}")
