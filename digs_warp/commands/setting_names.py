"""The names of settings: those of the flags, with underscores."""

from dataclasses import fields, is_dataclass
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import tyro

from digs_warp.settings import NO_FLAG


def setting_names(kind: type) -> list[str]:
    """Return the names of all settings of a dataclass and of those within."""
    found = []
    for name, _, hint in settings_of(kind):
        inner = next((each for each in alternatives(hint) if is_dataclass(each)), None)
        found += setting_names(inner) if isinstance(inner, type) else [name]
    return found


def settings_of(kind: type) -> list[tuple[str, str, Any]]:
    """Return (name of the setting, name of the field, type) of the fields that a user may set by name."""
    hints = get_type_hints(kind, include_extras=True)
    found = []
    for field in fields(kind):
        notes = getattr(hints[field.name], "__metadata__", ())
        if {tyro.conf.Suppress, tyro.conf.Positional, NO_FLAG} & set(notes):
            continue
        flags = [note.name for note in notes if getattr(note, "name", None)]
        name = flags[0].replace("-", "_") if flags else field.name
        found.append((name, field.name, hints[field.name]))
    return found


def file_settings(kind: type, within: str = "") -> dict[str, str]:
    """Return the settings of a dataclass that have no flag: by name, where they are in its settings file."""
    found: dict[str, str] = {}
    for name, hint in get_type_hints(kind, include_extras=True).items():
        inner = next((each for each in alternatives(hint) if is_dataclass(each)), None)
        if isinstance(inner, type):
            found |= file_settings(inner, f"{within}{name}.")
        elif NO_FLAG in getattr(hint, "__metadata__", ()) and not name.endswith("seed"):
            found[name] = f"{within}{name}"
    return found


def alternatives(hint: Any) -> list[Any]:
    """Return the types that a value may have, without annotations."""
    if get_origin(hint) is Annotated:
        return alternatives(get_args(hint)[0])
    if get_origin(hint) in (Union, UnionType):
        return [kind for each in get_args(hint) for kind in alternatives(each)]
    return [hint]
