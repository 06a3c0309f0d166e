"""A randomization: a YAML file that says for each setting of a recording from what it is drawn.

base: indoor                      # the rest is as there; 'nothing' draws no more than what is named
light_level: {normal: [0, 0.5], limits: [-1, 1]}
profile: {choice: [zed2-720, d435], weights: [2, 1]}
environment: skies/*.hdr          # one of these files, relative to this file
frames: 20
"""

import functools
import glob
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

from digs_warp.checks import DigsError
from digs_warp.record.fields import is_number, is_text, shown
from digs_warp.record.files import read_yaml
from digs_warp.sim.config import SimulateConfig
from digs_warp.words import did_you_mean

# Drawn beside the settings: how many meshes are chosen for a scene, instead of one.
OBJECT_COUNT = "object_count"

# The file of what is built in: the object, the room.
BUILT_IN = "built-in"

# A normal distribution without limits ends this many deviations from its mean.
USUAL_LIMIT = 3.0

FORMS = (
    "a value, {uniform: [low, high]}, {log_uniform: [low, high]} with 0 < low, {normal: [mean, deviation], "
    "limits: [low, high]}, or {choice: [...], weights: [...]}; low <= high, deviation and weights above 0"
)

SHIPPED_FOLDER = Path(__file__).resolve().parent
SHIPPED = tuple(sorted(path.stem for path in SHIPPED_FOLDER.glob("*.yaml")))
NOTHING, DEFAULT_BASE = "nothing", "indoor"


@dataclass(frozen=True)
class Distribution:
    """What a key is drawn from.

    Attributes:
        found: as the file has it.
        form: "choice", "uniform", "whole" (numbers), "log_uniform" or "normal".
        values: of a choice; else the lowest and the highest number. Settings have to allow all of them.
        shape: of a choice: how likely each value is; of a normal distribution: mean and deviation.
    """

    found: Any
    form: str
    values: tuple[Any, ...]
    shape: tuple[float, ...] = ()

    def at(self, share: float) -> Any:
        """Return the value below which that share lies, 0 <= share < 1."""
        if self.form == "choice":
            left = share * math.fsum(self.shape)
            for value, weight in zip(self.values, self.shape, strict=True):
                left -= weight
                if left < 0:
                    return value
            return self.values[-1]
        low, high = self.values
        if self.form == "whole":
            return min(low + int(share * (high - low + 1)), high)
        if self.form == "normal":
            return self._normal(share, low, high)
        return (
            low * (high / low) ** share
            if self.form == "log_uniform"
            else low + share * (high - low)
        )

    def _normal(self, share: float, low: float, high: float) -> float:
        from scipy.special import ndtr, ndtri

        mean, deviation = self.shape
        a, b = (low - mean) / deviation, (high - mean) / deviation
        # By symmetry in the lower tail, where the shares keep their digits.
        sign = -1 if a > 0 else 1
        away = sign * ndtri(ndtr(sign * a) + share * (ndtr(sign * b) - ndtr(sign * a)))
        return min(max(mean + deviation * float(away), low), high)

    def without(self, value: Any) -> "Distribution":
        """Return a choice among the other values; the same one if there are none."""
        left = [(v, w) for v, w in zip(self.values, self.shape, strict=True) if v != value]
        return Distribution(self.found, "choice", *zip(*left, strict=True)) if left else self

    @property
    def words(self) -> str:
        """As a file has it, for example {log_uniform: [0.5, 2]}."""
        import yaml

        text = yaml.safe_dump(self.found, default_flow_style=True, sort_keys=False, width=math.inf)
        return text.removesuffix("...\n").strip()


def even(values: Sequence[Any]) -> Distribution:
    """Return a choice of values that are all as likely."""
    return Distribution(list(values), "choice", tuple(values), (1.0,) * len(values))


@dataclass(frozen=True)
class Randomization:
    """Distributions by key, and the name of the file."""

    name: str
    entries: Mapping[str, Distribution] = field(default_factory=dict)


@functools.cache
def known_keys() -> dict[str, Any]:
    """Return the type of all keys by name, in the order of the settings."""
    # The seed of a scene follows from --seed and the number of the scene, or scenes would not differ.
    settings = {name: hint for name, hint in _types(SimulateConfig).items() if name != "seed"}
    return {OBJECT_COUNT: int, **settings}


def _types(kind: type) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, hint in get_type_hints(kind).items():
        found |= _types(hint) if is_dataclass(hint) else {name: hint}  # pyright: ignore[reportArgumentType]
    return found


def load_randomization(source: str | Path) -> Randomization:
    """Return one of ours by name, or read a YAML file.

    Raises:
        DigsError: an unknown name, or a file that is missing or broken; says which key, and what it expects.
    """
    if str(source) in SHIPPED:
        source = SHIPPED_FOLDER / f"{source}.yaml"
    elif Path(source).suffix.lower() not in (".yaml", ".yml"):
        raise DigsError(
            f"randomization '{source}': not known{did_you_mean(str(source), SHIPPED)}, or a .yaml file"
        )
    path = Path(source)
    where = f"randomization '{path}'"
    content = read_yaml(path, "randomization")
    base = content.pop("base", DEFAULT_BASE)
    if base not in (*SHIPPED, NOTHING):
        raise DigsError(
            f"{where}: base {shown(base)}, expected one of {', '.join((*SHIPPED, NOTHING))}"
        )
    own = entries_of(content, path.parent, where)
    rest = {} if base == NOTHING else load_randomization(base).entries
    return Randomization(path.stem, {**rest, **own})


def entries_of(content: Mapping[str, Any], folder: Path, where: str) -> dict[str, Distribution]:
    """Return the distributions by key of a YAML mapping whose files are relative to ``folder``."""
    known = known_keys()
    for name in content:
        if name not in known:
            raise DigsError(f"{where}: unknown key {shown(name)}{did_you_mean(str(name), known)}")
    return {
        name: _distribution(found, known[name], folder, f"{where}: {name}")
        for name, found in content.items()
    }


def _distribution(found: Any, hint: Any, folder: Path, where: str) -> Distribution:
    match found:
        case {"choice": [_, *_] as options, **more} if more.keys() <= {"weights"}:
            weights = more.get("weights", [1.0] * len(options))
            if _are_numbers(weights, len(options)) and min(weights) > 0:
                # A pattern stands for several files, which share its weight.
                named = [_values(option, hint, folder, where) for option in options]
                pairs = zip(named, weights, strict=True)
                shares = [weight / len(files) for files, weight in pairs for _ in files]
                values = [value for files in named for value in files]
                return Distribution(found, "choice", tuple(values), tuple(shares))
        case {"uniform": ends, **more} if not more and _are_rising(ends):
            is_whole = int in (hint, *get_args(hint)) and all(type(each) is int for each in ends)
            return Distribution(found, "whole" if is_whole else "uniform", tuple(ends))
        case {"log_uniform": ends, **more} if not more and _are_rising(ends) and ends[0] > 0:
            return Distribution(found, "log_uniform", tuple(ends))
        case {"normal": shape, **more} if more.keys() <= {"limits"} and _are_numbers(shape, 2):
            mean, deviation = shape
            away = USUAL_LIMIT * deviation
            limits = more.get("limits", [mean - away, mean + away])
            if deviation > 0 and _are_rising(limits):
                return Distribution(found, "normal", tuple(limits), (mean, deviation))
        case Mapping():
            pass
        case _:
            values = tuple(_values(found, hint, folder, where))
            return Distribution(found, "choice", values, (1.0,) * len(values))
    raise DigsError(f"{where}: found {shown(found)}, expected {FORMS}")


def _are_numbers(values: Any, count: int) -> bool:
    return isinstance(values, list) and len(values) == count and all(map(is_number, values))


def _are_rising(ends: Any) -> bool:
    return _are_numbers(ends, 2) and ends[0] <= ends[1]


def _values(found: Any, hint: Any, folder: Path, where: str) -> list[Any]:
    """Return a value in the form of its setting; of a pattern of files, one for each file."""
    is_list = get_origin(hint) is tuple
    if Path not in (hint, *get_args(hint)):
        return [as_listed(found, hint)]
    if found == BUILT_IN and not is_list:
        return [None]
    names = found if is_list and isinstance(found, list) else [found]
    files = [path for name in names for path in _files(name, folder, where)]
    return [files] if is_list else files


def _files(name: Any, folder: Path, where: str) -> list[Any]:
    """Return the files of a name or of a pattern, sorted."""
    if not is_text(name):
        raise DigsError(
            f"{where}: found {shown(name)}, expected the name of a file, a pattern such as 'skies/*.hdr', "
            f"or {BUILT_IN}"
        )
    if not glob.has_magic(name):
        return [str(folder / name)]
    found = sorted(glob.glob(name, root_dir=folder, recursive=True))
    files = [str(folder / each) for each in found if (folder / each).is_file()]
    if not files:
        raise DigsError(
            f"{where}: nothing in '{folder}' matches {shown(name)}; correct the pattern"
        )
    return files


def as_listed(value: Any, hint: Any) -> Any:
    """Return one value for a setting that is a list as a list of one."""
    return [value] if get_origin(hint) is tuple and not isinstance(value, list) else value
