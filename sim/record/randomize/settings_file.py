"""Settings files of a randomization: which settings are drawn, and from what distributions.

base: indoor                      # the rest is as there; 'nothing' draws no more than what is named
light_level: {normal: [0, 0.5], limits: [-1, 1]}
profile: {choice: [zed2-720, d435], weights: [2, 1]}
environment: skies/*.hdr          # one of these files, relative to this file
frames: 20
"""

import functools
import glob
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, TypeAlias, TypeVar, Union, get_args, get_origin, get_type_hints

from digs_warp.checks import DigsError
from digs_warp.record.fields import is_number, is_text, shown
from digs_warp.record.files import read_yaml
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.randomize.distributions import (
    Choice,
    Distribution,
    Normal,
    Span,
    Value,
)
from digs_warp.words import did_you_mean

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
    for each in fields(settings):  # pyright: ignore[reportArgumentType]
        value = getattr(settings, each.name)
        if is_dataclass(value):
            inner = with_values(value, values)
            changes |= {} if inner == value else {each.name: inner}
        elif each.name in values:
            changes[each.name] = values[each.name]
    return replace(settings, **changes) if changes else settings  # pyright: ignore[reportArgumentType]


def changed_names(settings: Any, usual: Any) -> set[str]:
    """Return the names of settings that differ from those in ``usual``, also within."""
    found: set[str] = set()
    for each in fields(settings):
        value, other = getattr(settings, each.name), getattr(usual, each.name)
        if is_dataclass(value):
            found |= changed_names(value, other)
        elif value != other:
            found.add(each.name)
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
            return Choice.even(*self._values(found))
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
        if self.key.kind == "whole number" and form != "uniform":
            raise self._wrong(found, "uniform or choice, because it is a whole number")
        return self._normal(found) if form == "normal" else self._span(found, form)

    def _span(self, found: Mapping[str, Any], form: Any) -> Distribution:
        low, high = self._pair(found, form, "low", "high")
        is_whole = self.key.kind == "whole number"
        if is_whole and not (low.is_integer() and high.is_integer()):
            raise self._wrong(found, "two whole numbers")
        if low > high:
            raise self._wrong(found, "low <= high; this range is empty")
        if form == "log_uniform" and low <= 0:
            raise self._wrong(found, "0 < low: factors have no zero; use uniform")
        return Span(int(low), int(high)) if is_whole else Span(low, high, form)

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


SHIPPED_FOLDER = Path(__file__).resolve().parent
SHIPPED = tuple(sorted(path.stem for path in SHIPPED_FOLDER.glob("*.yaml")))
BASE, NOTHING, DEFAULT_BASE = "base", "nothing", "indoor"


@dataclass(frozen=True)
class Randomization:
    """Distributions of settings.

    Attributes:
        name: that of the file, or of ours.
        entries: by key.
    """

    name: str
    entries: Mapping[str, Distribution] = field(default_factory=dict)


def load_randomization(source: str | Path) -> Randomization:
    """Return one of ours by name, or read a YAML file.

    Raises:
        DigsError: an unknown name, or a file that is missing or broken; says which key, and what it expects.
    """
    if str(source) in SHIPPED:
        return _read(SHIPPED_FOLDER / f"{source}.yaml")
    if Path(source).suffix.lower() not in (".yaml", ".yml"):
        raise DigsError(
            f"randomization '{source}': not known{did_you_mean(str(source), SHIPPED)}, or a .yaml file"
        )
    return _read(Path(source))


def _read(path: Path) -> Randomization:
    where = f"randomization '{path}'"
    content = read_yaml(path, "randomization")
    base = content.pop(BASE, DEFAULT_BASE)
    if base not in (*SHIPPED, NOTHING):
        raise DigsError(
            f"{where}: {BASE} {shown(base)}, expected one of {', '.join((*SHIPPED, NOTHING))}"
        )
    if path.parent == SHIPPED_FOLDER and base != NOTHING:
        raise DigsError(f"{where}: {BASE} {shown(base)}, expected {NOTHING}: it is a base itself")
    known = known_keys()
    for name in content:
        if name not in known:
            raise DigsError(f"{where}: unknown key {shown(name)}{did_you_mean(str(name), known)}")
    own = {
        name: Entry(f"{where}: {name}", known[name], path.parent).read(found)
        for name, found in content.items()
    }
    rest = {} if base == NOTHING else load_randomization(base).entries
    return Randomization(path.stem, {**rest, **own})
