"""How flags with numbers are read: a rule for tyro, whose own messages speak of Python's types."""

from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin

from tyro.constructors import PrimitiveConstructorSpec, PrimitiveTypeInfo

_EXPECTED = {int: "a whole number", float: "a number"}


def read_number_flag(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec | None:
    """Return how to read a number, one that can be None, or a tuple of numbers; None for other types."""
    outer = without_none(info.type)
    parts = get_args(outer) if get_origin(outer) is tuple else (outer,)
    kind: Any = parts[0] if parts else None
    if kind not in _EXPECTED or any(part not in (kind, ...) for part in parts):
        return None
    name = kind.__name__.upper()
    if outer is kind:
        return _spec(kind, 1, name, lambda words: _number(kind, words[0]))
    count: int | Literal["*"] = "*" if ... in parts else len(parts)
    metavar = f"[{name} [{name} ...]]" if count == "*" else " ".join([name] * count)
    return _spec(kind, count, metavar, lambda words: tuple(_number(kind, word) for word in words))


def _spec(
    kind: type, nargs: int | Literal["*"], metavar: str, read: Any
) -> PrimitiveConstructorSpec:
    accepted = (int, float) if kind is float else int

    def is_instance(value: Any) -> bool:
        values = value if isinstance(value, tuple) else (value,)
        return all(each is None or isinstance(each, accepted) for each in values)

    return PrimitiveConstructorSpec(
        nargs=nargs,
        metavar=metavar,
        instance_from_str=read,
        is_instance=is_instance,
        str_from_instance=lambda value: [
            str(each) for each in (value if isinstance(value, tuple) else (value,))
        ],
    )


def _number(kind: type, word: str) -> Any:
    try:
        return kind(word)
    except ValueError:
        raise ValueError(f"'{word}', expected {_EXPECTED[kind]}") from None


def without_none(kind: Any) -> Any:
    """Return the type, or the only other one where it can be None."""
    if get_origin(kind) not in (Union, UnionType):
        return kind
    options = [option for option in get_args(kind) if option is not NoneType]
    return options[0] if len(options) == 1 else kind
