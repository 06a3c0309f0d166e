"""One entry of a randomization file as a distribution: a value, or a mapping that names a distribution."""

import glob
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.record.fields import is_number, is_text, shown
from digs_warp.sim.record.randomize.distributions import (
    Choice,
    Distribution,
    Fixed,
    LogUniform,
    Normal,
    Uniform,
    UniformWhole,
    Value,
)
from digs_warp.sim.record.randomize.keys import Key
from digs_warp.words import did_you_mean

# Distribution -> the names that may stand beside it.
FORMS: dict[str, tuple[str, ...]] = {
    "uniform": (),
    "log_uniform": (),
    "normal": ("limits",),
    "choice": ("weights",),
}
# For numbers that have no limits, a normal distribution ends this many deviations from its mean.
USUAL_LIMIT = 3.0

# The file of what is built in: the object, the room.
BUILT_IN = "built-in"


@dataclass(frozen=True)
class Entry:
    """An entry to be read.

    Attributes:
        where: the file and the key, for messages.
        key: what it is about.
        folder: files are named relative to it.
    """

    where: str
    key: Key
    folder: Path

    def read(self, found: Any) -> Distribution:
        """Return the distribution.

        Raises:
            DigsError: a value of the wrong type, an empty range, or an unknown distribution.
        """
        if not isinstance(found, Mapping):
            values = self._values(found)
            return Fixed(values[0]) if len(values) == 1 else Choice.even(values)
        form = next((name for name in FORMS if name in found), None)
        if form is None:
            named = next(iter(found), "{}")
            raise self._wrong(found, f"one of {', '.join(FORMS)}", did_you_mean(str(named), FORMS))
        known = (form, *FORMS[form])
        for name in found:
            if name not in known:
                raise self._wrong(found, f"{form} without '{name}'", did_you_mean(str(name), known))
        if form == "choice":
            return self._choice(found)
        if self.key.kind not in ("number", "whole number"):
            raise self._wrong(
                found, f"a choice, because its values are no numbers: {self._values_are}"
            )
        if self.key.kind == "whole number":
            return self._uniform_whole(found, form)
        return self._normal(found) if form == "normal" else self._range(found, form)

    def _range(self, found: Mapping[str, Any], form: str) -> Distribution:
        low, high = self._pair(found, form, "low", "high")
        if low > high:
            raise self._wrong(found, "low <= high; this range is empty")
        if form == "uniform":
            return Uniform(low, high)
        if low <= 0:
            raise self._wrong(found, "0 < low: factors have no zero; use uniform")
        return LogUniform(low, high)

    def _uniform_whole(self, found: Mapping[str, Any], form: str) -> Distribution:
        if form != "uniform":
            raise self._wrong(found, "uniform or choice, because it is a whole number")
        low, high = self._pair(found, form, "low", "high")
        if low != int(low) or high != int(high):
            raise self._wrong(found, "two whole numbers")
        if low > high:
            raise self._wrong(found, "low <= high; this range is empty")
        return UniformWhole(int(low), int(high))

    def _normal(self, found: Mapping[str, Any]) -> Distribution:
        mean, deviation = self._pair(found, "normal", "mean", "deviation")
        if deviation <= 0:
            raise self._wrong(found, "a standard deviation above 0")
        low, high = mean - USUAL_LIMIT * deviation, mean + USUAL_LIMIT * deviation
        if "limits" in found:
            low, high = self._pair(found, "limits", "low", "high")
        if low >= high:
            raise self._wrong(found, "limits with low < high; this range is empty")
        return Normal(mean, deviation, low, high)

    def _choice(self, found: Mapping[str, Any]) -> Distribution:
        options = found["choice"]
        if not isinstance(options, Sequence) or isinstance(options, str) or not options:
            raise self._wrong(found, "a list of one value or more after 'choice'")
        weights = found.get("weights", [1] * len(options))
        if (
            not isinstance(weights, list)
            or len(weights) != len(options)
            or not all(is_number(weight) and weight > 0 for weight in weights)
        ):
            raise self._wrong(found, f"{len(options)} weights above 0, one for each value")
        values: list[Value] = []
        shares: list[float] = []
        for option, weight in zip(options, weights, strict=True):
            files = self._values(option)  # a pattern stands for several, which share its weight
            values += files
            shares += [weight / len(files)] * len(files)
        return Choice(tuple(values), tuple(shares))

    def _pair(self, found: Mapping[str, Any], name: str, *parts: str) -> tuple[float, float]:
        pair = found[name]
        if not isinstance(pair, list) or len(pair) != 2 or not all(map(is_number, pair)):
            raise self._wrong(found, f"{name}: [{', '.join(parts)}], two numbers")
        return float(pair[0]), float(pair[1])

    def _values(self, found: Any) -> tuple[Value, ...]:
        """Return a value; of a pattern of files, one for each file."""
        key = self.key
        if found is None and key.may_lack:
            return (None,)
        if key.kind == "file" and not key.is_list and found == BUILT_IN and key.may_lack:
            return (None,)
        if not key.is_list:
            return self._items(found)
        items = found if isinstance(found, list) else [found]
        return (tuple(value for item in items for value in self._items(item)),)  # pyright: ignore[reportReturnType]

    def _items(self, found: Any) -> tuple[Any, ...]:
        kind, words = self.key.kind, self.key.words
        if kind == "number" and is_number(found):
            return (float(found),)
        if kind == "whole number" and type(found) is int:
            return (found,)
        if kind == "true or false" and isinstance(found, bool):
            return (found,)
        if words and isinstance(found, str) and found not in words:
            raise self._wrong(found, self._values_are, did_you_mean(found, words))
        if kind == "text" and is_text(found):
            return (found,)
        if kind == "file" and is_text(found):
            return tuple(self._files(found))
        ranges = isinstance(found, list) and len(found) == 2 and all(map(is_number, found))
        meant = f"; a range is {{uniform: {shown(found)}}}" if ranges else ""
        raise self._wrong(found, self._values_are, meant)

    def _files(self, name: str) -> list[Path]:
        """Return the files of a name or of a pattern, sorted."""
        if not glob.has_magic(name):
            return [self.folder / name]
        found = sorted(glob.glob(name, root_dir=self.folder, recursive=True))
        files = [self.folder / each for each in found if (self.folder / each).is_file()]
        if not files:
            raise self._wrong(name, f"a pattern of files; nothing in '{self.folder}' matches")
        return files

    @property
    def _values_are(self) -> str:
        key = self.key
        what = f"one of {', '.join(key.words)}" if key.words else f"a {key.kind}"
        if key.kind == "file":
            what = f"the name of a file, a pattern such as 'skies/*.hdr', or {BUILT_IN}"
        if key.kind == "true or false":
            what = key.kind
        return f"{what}, or a list of such" if key.is_list else what

    def _wrong(self, found: Any, expected: str, more: str = "") -> DigsError:
        return DigsError(f"{self.where}: found {shown(found)}, expected {expected}{more}")
