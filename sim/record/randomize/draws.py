"""Scenes drawn from a randomization: a YAML file that says for each setting from what it is drawn.

base: indoor                      # the rest is as there; 'nothing' draws no more than what is named
light_level: {normal: [0, 0.5], limits: [-1, 1]}
profile: {choice: [zed2-720, d435], weights: [2, 1]}
environment: skies/*.hdr          # one of these files, relative to this file
frames: 20

A draw of key k in scene i depends on (seed, i, k) alone: more scenes, another distribution or another key
change no other draw. One uniform number decides it, so that a similar distribution gives a similar value.
"""

import functools
import glob
import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.record.fields import is_number, is_text, shown
from digs_warp.record.files import read_yaml
from digs_warp.record.typed import from_json, to_json
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.scene.scene import MOST_OBJECTS
from digs_warp.words import did_you_mean

SEEDS = 2**31  # those that --seed takes

# Drawn beside the settings: how many meshes are chosen for a scene, instead of one.
OBJECT_COUNT, DISTRACTOR_MESH_COUNT = "object_count", "distractor_mesh_count"
LEAST_COUNT = {OBJECT_COUNT: 1, DISTRACTOR_MESH_COUNT: 0}

# Lists with one value for each object, in the order of the objects.
PER_OBJECT = ("roughness_factor", "tint", "tint_hue")

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
    return {OBJECT_COUNT: int, DISTRACTOR_MESH_COUNT: int, **settings}


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
        return [_listed(found, hint)]
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


def _listed(value: Any, hint: Any) -> Any:
    """Return one value for a setting that is a list as a list of one."""
    return [value] if get_origin(hint) is tuple and not isinstance(value, list) else value


@dataclass(frozen=True)
class SceneJob:
    """One recording of a data set.

    Attributes:
        name: its folder below that of the data set: mesh/environment/walk, or the number of the draw.
        config: what to record.
        drawn: what was drawn at random, by key, as JSON has it, with the seed; empty: nothing was.
    """

    name: str
    config: SimulateConfig
    drawn: Mapping[str, Any] = field(default_factory=dict)


def draw_scenes(
    randomization: Randomization,
    config: SimulateConfig,
    count: int,
    meshes: Sequence[Path] = (),
    environments: Sequence[Path] = (),
) -> tuple[SceneJob, ...]:
    """Return ``count`` scenes.

    Args:
        randomization: what is drawn.
        config: everything else, and the seed. A setting that differs from its default is not drawn.
        count: >= 1.
        meshes: one of them is chosen for each scene; none: as the randomization says.
        environments: the same.

    Raises:
        DigsError: a distribution with values that its setting does not allow.
    """
    given = _flat(to_json(config)).items() - _flat(to_json(SimulateConfig())).items()
    entries = {k: v for k, v in randomization.entries.items() if k not in dict(given)}
    for key, files in (("mesh", meshes), ("environment", environments)):
        if files:
            entries[key] = even([str(path) for path in files])
    if config.scene:  # these objects and no others
        entries.pop("mesh", None)
    where = f"randomization '{randomization.name}'"
    _check(where, entries, config)
    return tuple(_scene(where, entries, config, number) for number in range(count))


def _flat(settings: Mapping[str, Any]) -> dict[str, str]:
    """Return settings and those within by name, in words."""
    found: dict[str, str] = {}
    for name, value in settings.items():
        found |= _flat(value) if isinstance(value, dict) else {name: repr(value)}
    return found


def share_of(seed: int, scene: int, key: str, item: int = 0) -> float:
    """Return the uniform number in [0, 1) that decides a draw.

    Args:
        seed: of the data set.
        scene: number of the scene.
        key: what is drawn.
        item: of a list that is drawn item by item.
    """
    name = int.from_bytes(hashlib.sha256(key.encode()).digest()[:8], "little")
    (bits,) = np.random.SeedSequence([seed, scene, name, item]).generate_state(1, np.uint64)
    return float(bits >> np.uint64(11)) * 2.0**-53


def _scene(
    where: str, entries: Mapping[str, Distribution], config: SimulateConfig, number: int
) -> SceneJob:
    share = functools.partial(share_of, config.seed, number)
    drawn = _meshes(entries, share)
    objects = len(drawn.get("scene", config.scene)) or 1
    for key, entry in entries.items():
        if key in ("mesh", *LEAST_COUNT):
            continue
        value = entry.at(share(key))
        if key in PER_OBJECT and not isinstance(value, list):
            value = [entry.at(share(key, item)) for item in range(objects)]
        drawn[key] = _listed(value, known_keys()[key])
    drawn["seed"] = int(share("seed") * SEEDS)
    return SceneJob(f"{number:04d}", _with(config, drawn, where), drawn)


def _meshes(entries: Mapping[str, Distribution], share: Callable[..., float]) -> dict[str, Any]:
    """Return the meshes of objects and distractors: each another one, as long as there are any."""
    if "mesh" not in entries:
        return {}
    counts = [
        entries[key].at(share(key)) if key in entries else usual
        for key, usual in ((OBJECT_COUNT, 1), (DISTRACTOR_MESH_COUNT, 0))
    ]
    left, chosen = entries["mesh"], []
    for item in range(sum(counts)):
        chosen.append(left.at(share("mesh", item)))
        left = left.without(chosen[-1])
    objects, others = chosen[: counts[0]], chosen[counts[0] :]
    found = {"distractor_meshes": others} if others else {}
    return {**found, **({"mesh": objects[0]} if len(objects) == 1 else {"scene": objects})}


def _with(config: SimulateConfig, values: Mapping[str, Any], where: str) -> SimulateConfig:
    """Return settings with some changed by name, also those of settings within.

    Raises:
        DigsError: a value of the wrong type or out of its range, or values that contradict each other.
    """
    settings = to_json(config)
    for each in fields(config):
        within = getattr(config, each.name)
        if is_dataclass(within):
            names = {inner.name for inner in fields(within)} & values.keys()
            settings[each.name] |= {name: values[name] for name in names}
        elif each.name in values:
            settings[each.name] = values[each.name]
    return from_json(SimulateConfig, settings, where, strict=True)


def _check(where: str, entries: Mapping[str, Distribution], config: SimulateConfig) -> None:
    """Try all values of every choice and the ends of the others, beside the first value of the rest."""
    from digs_warp.sim.record.inputs import rig_of
    from digs_warp.sim.record.sensor_plan import check_effects

    known = known_keys()
    first = {key: _listed(entry.values[0], known[key]) for key, entry in entries.items()}
    for key, entry in entries.items():
        what = f"{where}: {key} {entry.words}"
        for value in entry.values:
            try:
                _check_count(key, value, entries)
                tried = _with(config, {**first, key: _listed(value, known[key])}, "settings")
                check_effects(tried)
                rig_of(tried)
            except DigsError as error:
                raise DigsError(f"{what}: {error}") from error
            for path in (tried.mesh, tried.environment):
                if path is not None and not path.is_file():
                    raise DigsError(f"{what}: '{path}': no such file")


def _check_count(key: str, value: Any, entries: Mapping[str, Distribution]) -> None:
    least = LEAST_COUNT.get(key)
    if least is None:
        return
    if type(value) is not int or not least <= value <= MOST_OBJECTS:
        raise DigsError(f"{value}, expected a whole number, {least} to {MOST_OBJECTS}")
    if value > least and "mesh" in entries and None in entries["mesh"].values:
        raise DigsError(
            f"{value} meshes, but 'mesh' can be the built-in object, which stands alone; leave it out there"
        )
