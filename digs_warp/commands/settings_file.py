"""Names of settings, and ``--config FILE``: the settings of an earlier run as the defaults of a command."""

from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import tyro

from digs_warp.checks import DigsError
from digs_warp.commands.command import SettingsCommand
from digs_warp.record.files import read_json, read_yaml
from digs_warp.record.layout import places_of
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


def read_defaults(kind: type[SettingsCommand], path: Path) -> SettingsCommand:
    """Return a command with the settings in a file; its required flags are `tyro.MISSING`.

    Args:
        kind: the command.
        path: a run.json, or JSON or YAML with its "settings" and, if it likes, its "command".
    """
    is_yaml = path.suffix.lower() in (".yaml", ".yml")
    record = (read_yaml if is_yaml else read_json)(path, "--config")
    command = record.get("command", kind.recorded_as)
    if command != kind.recorded_as:
        raise DigsError(
            f"--config '{path}': settings of 'digs-warp {command}'; expected those of "
            f"'digs-warp {kind.recorded_as}'"
        )
    if not isinstance(record.get("settings"), dict):
        raise DigsError(
            f"--config '{path}': no \"settings\" by name in it; expected the form of a run.json"
        )
    try:
        return _with_found_files(kind.from_settings(record["settings"]), path)
    except DigsError as error:
        raise DigsError(f"--config '{path}': {error}") from error


def _with_found_files(value: Any, config: Path) -> Any:
    """Return settings whose files are where they lie as seen from this folder; what is nowhere stays."""
    if isinstance(value, Path):
        with suppress(OSError):  # a name longer than the system allows
            return next((place for place in places_of(value, config) if place.exists()), value)
        return value
    if isinstance(value, tuple):
        found = tuple(_with_found_files(each, config) for each in value)
        return value if all(a is b for a, b in zip(found, value, strict=True)) else found
    if not is_dataclass(value) or isinstance(value, type):
        return value
    old = {field.name: getattr(value, field.name) for field in fields(value) if field.init}
    new = {name: _with_found_files(each, config) for name, each in old.items()}
    changed = {name: each for name, each in new.items() if each is not old[name]}
    return replace(value, **changed) if changed else value
