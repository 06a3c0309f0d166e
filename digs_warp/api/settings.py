"""Keywords -> settings: names, defaults and rules are those of the command line's flags."""

from collections.abc import Mapping
from dataclasses import is_dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin

from digs_warp.checks import DigsError
from digs_warp.commands.settings_file import alternatives, setting_names, settings_of
from digs_warp.words import did_you_mean

T = TypeVar("T")


def with_settings(options: T, settings: Mapping[str, Any]) -> T:
    """Return options with some settings changed, also those of options within.

    Args:
        options: a dataclass as a command of `digs_warp.commands` takes it.
        settings: by name of the flag, with underscores: ``time_budget=60.0`` is ``--time-budget 60s``.

    Raises:
        DigsError: a name that is no setting, a choice that does not exist, or a value out of range.
    """
    names = sorted(setting_names(type(options)))
    for name in settings:
        if name not in names:
            raise DigsError(f"{name}: no such setting{did_you_mean(name, names)}")
    return _changed(options, settings)


def _changed(options: T, settings: Mapping[str, Any]) -> T:
    changes: dict[str, Any] = {}
    for name, field, hint in settings_of(type(options)):
        value = getattr(options, field)
        if is_dataclass(value):
            changes[field] = _changed(value, settings)
        elif name in settings:
            changes[field] = _checked(name, settings[name], hint)
    return replace(options, **changes)  # pyright: ignore[reportArgumentType]


def _checked(name: str, value: Any, hint: Any) -> Any:
    kinds = alternatives(hint)
    choices = [choice for kind in kinds if get_origin(kind) is Literal for choice in get_args(kind)]
    if choices and value not in choices:
        raise DigsError(f"{name}: {value!r}, expected one of {', '.join(map(str, choices))}")
    return Path(value) if isinstance(value, str) and Path in kinds else value
