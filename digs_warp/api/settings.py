"""Keyword settings -> configuration: the names and defaults are those of the command line's flags."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import tyro

from digs_warp.checks import DigsError

T = TypeVar("T")


def with_settings(options: T, settings: Mapping[str, Any]) -> T:
    """Return options with some settings changed, also those of options within.

    Args:
        options: a dataclass as a command of `digs_warp.commands` takes it.
        settings: by name of the flag, with underscores: ``time_budget=60.0`` is ``--time-budget 60s``.

    Raises:
        DigsError: a name that is no setting, a choice that does not exist, or a value out of range.
    """
    names = set(setting_names(type(options)))
    for name in settings:
        if name not in names:
            close = get_close_matches(name, names, n=1)
            hint = f"did you mean {close[0]}?" if close else f"one of {', '.join(sorted(names))}"
            raise DigsError(f"{name}: no such setting; {hint}")
    return _changed(options, settings)


def setting_names(kind: type) -> list[str]:
    """Return the names of all settings of a dataclass and of those within."""
    found = []
    for name, _, hint in _settings(kind):
        inner = _dataclass_in(hint)
        found += setting_names(inner) if inner else [name]
    return found


def _changed(options: T, settings: Mapping[str, Any]) -> T:
    changes: dict[str, Any] = {}
    for name, field, hint in _settings(type(options)):
        value = getattr(options, field)
        if is_dataclass(value):
            changes[field] = _changed(value, settings)
        elif name in settings:
            changes[field] = _checked(name, settings[name], hint)
    return replace(options, **changes)  # pyright: ignore[reportArgumentType]


def _settings(kind: type) -> list[tuple[str, str, Any]]:
    """Return (name of the setting, name of the field, type) of the fields that a user may set."""
    hints = get_type_hints(kind, include_extras=True)
    found = []
    for field in fields(kind):
        notes = getattr(hints[field.name], "__metadata__", ())
        if tyro.conf.Suppress in notes:
            continue
        flags = [note.name for note in notes if getattr(note, "name", None)]
        name = flags[0].replace("-", "_") if flags else field.name
        found.append((name, field.name, hints[field.name]))
    return found


def _checked(name: str, value: Any, hint: Any) -> Any:
    kinds = _alternatives(hint)
    choices = [choice for kind in kinds if get_origin(kind) is Literal for choice in get_args(kind)]
    if choices and value not in (*choices, *((None,) if type(None) in kinds else ())):
        raise DigsError(f"{name}: {value!r}, expected one of {', '.join(map(str, choices))}")
    return Path(value) if isinstance(value, str) and Path in kinds else value


def _dataclass_in(hint: Any) -> type | None:
    return next((kind for kind in _alternatives(hint) if is_dataclass(kind)), None)  # pyright: ignore


def _alternatives(hint: Any) -> list[Any]:
    """Return the types that a value may have, without annotations."""
    if get_origin(hint) is Annotated:
        return _alternatives(get_args(hint)[0])
    if get_origin(hint) in (Union, UnionType):
        return [kind for each in get_args(hint) for kind in _alternatives(each)]
    return [hint]
