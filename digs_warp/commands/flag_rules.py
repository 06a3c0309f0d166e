"""How flags look in the help, how numbers are read, how wrong values are explained: rules for tyro."""

import re
from collections.abc import Collection
from dataclasses import is_dataclass, replace
from functools import partial, wraps
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import tyro
from tyro.constructors import (
    MISSING_NONPROP,
    ConstructorRegistry,
    PrimitiveConstructorSpec,
    PrimitiveTypeInfo,
    StructConstructorSpec,
    StructFieldSpec,
    StructTypeInfo,
)

from digs_warp.checks import DigsError
from digs_warp.settings import NO_FLAG


class RefusedSettings(Exception):
    """Settings that a dataclass refuses. No ValueError: tyro would put the name of the class before it."""


class FlagRules(ConstructorRegistry):
    """Rules for one command line.

    Attributes:
        hidden: flags that the help leaves for --help-all; filled while tyro reads the command.
    """

    def __init__(
        self,
        shown: Collection[str] = (),
        useless: Collection[str] = (),
        describes_groups: bool = True,
    ) -> None:
        """Make the rules.

        Args:
            shown: the flags that the help shows; empty: all. The others cannot be parsed.
            useless: flags that make no sense for this command.
            describes_groups: whether the help is shown, in which groups of flags have a description.
        """
        super().__init__()
        self.hidden: set[str] = set()
        self._shown = shown
        self._useless = useless
        self._describes_groups = describes_groups
        self._inside = False
        self.struct_rule(self._struct)
        self.primitive_rule(read_number_flag)

    def _struct(self, info: StructTypeInfo) -> StructConstructorSpec | None:
        """Return tyro's own reading of a dataclass, with our look."""
        if self._inside:  # asked below for tyro's own
            return None
        self._inside = True
        try:
            spec = ConstructorRegistry.get_struct_spec(info)
        finally:
            self._inside = False
        if not isinstance(spec, StructConstructorSpec):
            return None
        fields = tuple(self._field(field) for field in spec.fields)
        return replace(spec, fields=fields, instantiate=_explaining(spec.instantiate))

    def _field(self, field: StructFieldSpec) -> StructFieldSpec:
        is_annotated = get_origin(field.type) is Annotated
        kind, *markers = get_args(field.type) if is_annotated else (field.type,)
        if is_dataclass(kind) and not self._describes_groups:
            return replace(field, helptext="")
        if is_dataclass(kind) or tyro.conf.Suppress in markers:
            return field
        if NO_FLAG in markers:
            markers += (tyro.conf.Suppress, tyro.conf.Fixed)
            return replace(field, type=Annotated[(kind, *markers)], helptext="")
        is_switch = field.default is False and tyro.conf.FlagCreatePairsOff in markers
        if is_switch or field.default in (None, "", ()):
            markers.append(tyro.conf.arg(help_behavior_hint=""))  # no "(default: None)"
        elif field.default is MISSING_NONPROP and get_origin(kind) is tuple:
            markers.append(tyro.conf.arg(help_behavior_hint="(one or more)"))
        names = [name for marker in markers if (name := getattr(marker, "name", None))]
        flag = names[0].replace("-", "_") if names else field.name
        if flag in self._useless:
            markers.append(tyro.conf.Suppress)
        elif self._shown and flag not in self._shown:
            markers.append(tyro.conf.Suppress)
            self.hidden.add(flag)
        kind = Annotated[(kind, *markers)] if markers else kind
        return replace(field, type=kind, helptext=partial(_text_of, field))


def _text_of(field: StructFieldSpec) -> str | None:
    """Return the help of a field. Only a help is worth reading the source for docstrings of fields."""
    text = field.helptext() if callable(field.helptext) else field.helptext
    return text and paragraphs(text)


def paragraphs(text: str) -> str:
    """Return a docstring with each paragraph in one line; the terminal wraps it."""
    return "\n\n".join(" ".join(part.split()) for part in re.split(r"\n\s*\n", text.strip()))


def _explaining(instantiate: Any) -> Any:
    """Make a constructor raise `RefusedSettings` where it raises a `DigsError`."""

    @wraps(instantiate, updated=())  # tyro reads the description of a group of flags from it
    def make(**values: Any) -> Any:
        try:
            return instantiate(**values)
        except DigsError as error:
            raise RefusedSettings(str(error)) from error

    return make


_EXPECTED = {int: "a whole number", float: "a number"}


def read_number_flag(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec | None:
    """Return how to read a number, one that can be None, or a tuple of numbers; None for other types."""
    outer = without_none(info.type)
    is_tuple = get_origin(outer) is tuple
    parts = get_args(outer) if is_tuple else (outer,)
    kind: Any = parts[0] if parts else None
    if kind not in _EXPECTED or any(part not in (kind, ...) for part in parts):
        return None
    is_endless, name = ... in parts, kind.__name__.upper()

    def values(value: Any) -> tuple[Any, ...]:
        return value if isinstance(value, tuple) else (value,)

    def read(words: list[str]) -> Any:
        try:
            found = tuple(kind(word) for word in words)
        except ValueError as error:
            word = str(error).partition(": ")[2]
            raise ValueError(f"{word}, expected {_EXPECTED[kind]}") from None
        return found if is_tuple else found[0]

    return PrimitiveConstructorSpec(
        nargs="*" if is_endless else len(parts),
        metavar=f"[{name} [{name} ...]]" if is_endless else " ".join([name] * len(parts)),
        instance_from_str=read,
        is_instance=lambda value: all(
            each is None or isinstance(each, (kind, int)) for each in values(value)
        ),
        str_from_instance=lambda value: [str(each) for each in values(value)],
    )


def without_none(kind: Any) -> Any:
    """Return the type, or the only other one where it can be None."""
    if get_origin(kind) not in (Union, UnionType):
        return kind
    options = [option for option in get_args(kind) if option is not NoneType]
    return options[0] if len(options) == 1 else kind
