"""Scenes drawn from a randomization.

A draw of key k in scene i depends on (seed, i, k) alone: more scenes, another distribution or another key
change no other draw. One uniform number decides it, so that a similar distribution gives a similar value.
"""

import functools
import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.record.typed import from_json, to_json
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.randomize.randomization import (
    OBJECT_COUNT,
    Distribution,
    Randomization,
    as_listed,
    even,
    known_keys,
)
from digs_warp.sim.scene.scene import MOST_OBJECTS

SEEDS = 2**31  # those that --seed takes

# Lists with one value for each object, in the order of the objects.
PER_OBJECT = ("roughness_factor", "tint", "tint_hue")


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
        if key in ("mesh", OBJECT_COUNT):
            continue
        value = entry.at(share(key))
        if key in PER_OBJECT and not isinstance(value, list):
            value = [entry.at(share(key, item)) for item in range(objects)]
        drawn[key] = as_listed(value, known_keys()[key])
    drawn["seed"] = int(share("seed") * SEEDS)
    return SceneJob(f"{number:04d}", _with(config, drawn, where), drawn)


def _meshes(entries: Mapping[str, Distribution], share: Callable[..., float]) -> dict[str, Any]:
    """Return the meshes of the objects: each another one, as long as there are any."""
    if "mesh" not in entries:
        return {}
    count = entries[OBJECT_COUNT].at(share(OBJECT_COUNT)) if OBJECT_COUNT in entries else 1
    left, chosen = entries["mesh"], []
    for item in range(count):
        chosen.append(left.at(share("mesh", item)))
        left = left.without(chosen[-1])
    return {"mesh": chosen[0]} if count == 1 else {"scene": chosen}


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
    first = {key: as_listed(entry.values[0], known[key]) for key, entry in entries.items()}
    for key, entry in entries.items():
        what = f"{where}: {key} {entry.words}"
        for value in entry.values:
            try:
                if key == OBJECT_COUNT:
                    _check_count(value, entries)
                tried = _with(config, {**first, key: as_listed(value, known[key])}, "settings")
                check_effects(tried)
                rig_of(tried)
            except DigsError as error:
                raise DigsError(f"{what}: {error}") from error
            for path in (tried.mesh, tried.environment):
                if path is not None and not path.is_file():
                    raise DigsError(f"{what}: '{path}': no such file")


def _check_count(value: Any, entries: Mapping[str, Distribution]) -> None:
    if type(value) is not int or not 1 <= value <= MOST_OBJECTS:
        raise DigsError(f"{value}, expected a whole number, 1 to {MOST_OBJECTS}")
    if value > 1 and "mesh" in entries and None in entries["mesh"].values:
        raise DigsError(
            f"{value} meshes, but 'mesh' can be the built-in object, which stands alone; leave it out there"
        )
