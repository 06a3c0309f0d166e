"""JSON from anywhere: parsed within bounds, its values read by name, with their type and range checked."""

import json
import math
import reprlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.words import LONGEST_QUOTE

T = TypeVar("T")

# No count, size or time has more digits; Python refuses thousands of them, floats overflow at 309.
MOST_DIGITS = 30

ABOVE_ZERO = math.ulp(0.0)  # the smallest number

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = LONGEST_QUOTE


class _Needed:
    """Stands for the default of a value that has to be there."""


NEEDED = _Needed()


def parse_json(text: str | bytes) -> Any:
    """Return the values of a JSON text.

    Raises:
        ValueError: not valid JSON, nested deeper than Python's stack, or an integer of very many digits.
    """
    try:
        return json.loads(text, parse_int=_integer)
    except RecursionError:
        raise ValueError("nested too deeply") from None


def _integer(digits: str) -> int:
    if len(digits) > MOST_DIGITS:
        raise ValueError(f"a number of {len(digits)} digits, {digits[:8]}...")
    return int(digits)


def shown(value: Any) -> str:
    """Return a value for a message: values of files may be of any length and depth."""
    return _SHORT.repr(value)


@dataclass(frozen=True)
class Fields:
    """The values of a JSON object, each read by its name.

    A method raises ``error`` if the value is of another type or out of range, or if it is missing and has no
    default; null counts as missing. Numbers are finite.

    Attributes:
        values: the object.
        where: prefix of messages: the file, and the place in it.
        error: what is raised.
        shared: values that count where the object itself has none.
        remedy: what to do about a broken file; the end of messages.
    """

    values: Mapping[str, Any]
    where: str
    error: type[DigsError] = DigsError
    shared: Mapping[str, Any] | None = None
    remedy: str = ""

    @staticmethod
    def of(value: Any, where: str, error: type[DigsError] = DigsError) -> "Fields":
        """Return the fields of a value that has to be an object."""
        if not isinstance(value, Mapping):
            raise error(f"{where}: expected a JSON object, found {shown(value)}")
        return Fields(value, where, error)

    def __contains__(self, name: str) -> bool:
        return self._find(name) is not None

    def whole(
        self, name: str, low: float = 0, high: float = 2**63, default: T | _Needed = NEEDED
    ) -> int | T:
        """Return a whole number from ``low`` to ``high``."""
        upto = f" to {high:g}" if high < 2**63 else " or more"
        value = self._fitting(
            name,
            default,
            lambda v: is_number(v) and v == int(v) and low <= v <= high,
            f"a whole number, {low:g}{upto}",
        )
        return value if value is default else int(value)

    def number(
        self,
        name: str,
        low: float = -math.inf,
        high: float = math.inf,
        default: T | _Needed = NEEDED,
        what: str = "a finite number",
    ) -> float | T:
        """Return a number from ``low`` to ``high``; ``what`` describes it in messages."""
        value = self._fitting(name, default, lambda v: is_number(v) and low <= v <= high, what)
        return value if value is default else float(value)

    def text(self, name: str, default: T | _Needed = NEEDED) -> str | T:
        """Return a text without characters that no file name can have."""
        return self._fitting(name, default, is_text, "a text")

    def flag(self, name: str, default: T | _Needed = NEEDED) -> bool | T:
        """Return true or false."""
        return self._fitting(name, default, lambda v: isinstance(v, bool), "true or false")

    def array(
        self, name: str, shape: Sequence[int], default: T | _Needed = NEEDED, finite: bool = True
    ) -> np.ndarray | T:
        """Return lists of numbers as an array of float64; -1 in ``shape`` fits any length."""
        value = self._find(name, default)
        if value is default:
            return value
        try:
            numbers = list(_flat(value)) if isinstance(value, list) else [None]
            if all(is_number(v) or (isinstance(v, float) and not finite) for v in numbers):
                return np.array(numbers, dtype=np.float64).reshape(shape)
        except ValueError:  # another shape
            pass
        raise self._wrong(name, value, f"{_size(shape)} finite numbers")

    def section(self, name: str, optional: bool = False) -> "Fields":
        """Return an object inside this one; an empty one if it is missing and ``optional``."""
        value = self._find(name, {} if optional else NEEDED)
        return self._inside(value, f"{self.where}, {name}")

    def sections(self, name: str, default: T | _Needed = NEEDED) -> "list[Fields] | T":
        """Return a list of objects."""
        value = self._fitting(name, default, lambda v: isinstance(v, list), "a list of objects")
        if value is default:
            return value
        return [self._inside(item, f"{self.where}, {name} {i}") for i, item in enumerate(value)]

    def _inside(self, value: Any, where: str) -> "Fields":
        if not isinstance(value, Mapping):
            raise replace(self, where=where)._broken(
                f"expected a JSON object, found {shown(value)}"
            )
        return replace(self, values=value, where=where, shared=None)

    def _fitting(self, name: str, default: Any, fits: Callable[[Any], bool], expected: str) -> Any:
        value = self._find(name, default)
        if value is not default and not fits(value):
            raise self._wrong(name, value, expected)
        return value

    def _find(self, name: str, default: Any = None) -> Any:
        value = self.values.get(name)
        if value is None and self.shared is not None:
            value = self.shared.get(name)
        if value is not None:
            return value
        if default is NEEDED:
            raise self._broken(f"has no '{name}'")
        return default

    def _wrong(self, name: str, value: Any, expected: str) -> DigsError:
        return self._broken(f"{name} is {shown(value)}, expected {expected}")

    def _broken(self, what: str) -> DigsError:
        return self.error(f"{self.where}: {what}{self.remedy and '; ' + self.remedy}")


def is_number(value: Any) -> bool:
    """Whether a JSON value is a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # YAML has integers of hundreds of digits
        return False


def is_text(value: Any) -> bool:
    """Whether a JSON value is a text that can be a file name: no NUL and no half of a character."""
    if not isinstance(value, str) or "\0" in value:
        return False
    # Except those by which Python writes the bytes of names that are no UTF-8.
    return not any("\ud800" <= c <= "\udfff" and not "\udc80" <= c <= "\udcff" for c in value)


def _flat(values: list[Any]) -> Iterator[Any]:
    for value in values:
        if isinstance(value, list):
            yield from _flat(value)
        else:
            yield value


def _size(shape: Sequence[int]) -> str:
    return " x ".join("any" if length < 0 else str(length) for length in shape)
