"""What can be drawn: every setting of a recording, under the name of its flag with underscores."""

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, TypeAlias, TypeVar, Union, get_args, get_origin, get_type_hints

from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.randomize.distributions import Value

T = TypeVar("T")

Kind: TypeAlias = Literal["number", "whole number", "true or false", "text", "file"]

KINDS: dict[Any, Kind] = {
    float: "number",
    int: "whole number",
    bool: "true or false",
    str: "text",
    Path: "file",
}

# The seed of a scene follows from --seed and the number of the scene, or scenes would not differ.
NOT_DRAWN = ("seed",)

# Drawn beside the settings: how many meshes are chosen for a scene, instead of one.
OBJECT_COUNT, DISTRACTOR_MESH_COUNT = "object_count", "distractor_mesh_count"

# Lists with one value for each object, in the order of the objects.
PER_OBJECT = ("roughness_factor", "tint", "tint_hue")


@dataclass(frozen=True)
class Key:
    """A setting that can be drawn.

    Attributes:
        name: that of the flag, with underscores.
        kind: of its values; of the items of a list.
        words: the texts that are allowed; empty: any.
        is_list: whether it takes several values.
        may_lack: whether it can be left out (null), which the flag's help explains.
    """

    name: str
    kind: Kind
    words: tuple[str, ...] = ()
    is_list: bool = False
    may_lack: bool = False

    @property
    def per_object(self) -> bool:
        """Whether every object gets its own draw."""
        return self.name in PER_OBJECT


@functools.cache
def known_keys() -> dict[str, Key]:
    """Return all keys by name, in the order of the settings."""
    counts = (Key(name, "whole number") for name in (OBJECT_COUNT, DISTRACTOR_MESH_COUNT))
    return {key.name: key for key in (*counts, *_keys_of(SimulateConfig))}


def with_values(settings: T, values: Mapping[str, Value]) -> T:
    """Return settings with some changed by name, also those of settings within.

    Raises:
        DigsError: a value out of its range, or values that contradict each other.
    """
    changes: dict[str, Any] = {}
    for field in fields(settings):  # pyright: ignore[reportArgumentType]
        value = getattr(settings, field.name)
        if is_dataclass(value):
            inner = with_values(value, values)
            changes |= {} if inner == value else {field.name: inner}
        elif field.name in values:
            changes[field.name] = values[field.name]
    return replace(settings, **changes) if changes else settings  # pyright: ignore[reportArgumentType]


def changed_names(settings: Any, usual: Any) -> set[str]:
    """Return the names of settings that differ from those in ``usual``, also within."""
    found: set[str] = set()
    for field in fields(settings):
        value, other = getattr(settings, field.name), getattr(usual, field.name)
        if is_dataclass(value):
            found |= changed_names(value, other)
        elif value != other:
            found.add(field.name)
    return found


def _keys_of(settings: type) -> Iterator[Key]:
    for name, hint in get_type_hints(settings).items():
        if is_dataclass(hint):
            yield from _keys_of(hint)  # pyright: ignore[reportArgumentType]
        elif name not in NOT_DRAWN:
            yield _key(name, hint)


def _key(name: str, hint: Any) -> Key:
    options = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    (kind,) = (option for option in options if option is not NoneType)
    is_list = get_origin(kind) is tuple
    inner = get_args(kind)[0] if is_list else kind
    words = get_args(inner) if get_origin(inner) is Literal else ()
    return Key(name, KINDS[str if words else inner], words, is_list, NoneType in options)
