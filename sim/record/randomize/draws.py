"""Scenes drawn from a randomization: the settings of each, which say all that is needed to make it again.

A draw of key k in scene i depends on (seed, i, k) alone. More scenes, another distribution or another key
change no other draw.
"""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.randomize.distributions import Choice, Distribution, Value, as_json
from digs_warp.sim.record.randomize.settings_file import (
    DISTRACTOR_MESH_COUNT,
    OBJECT_COUNT,
    Key,
    Randomization,
    changed_names,
    known_keys,
    with_values,
)
from digs_warp.sim.scene.scene import MOST_OBJECTS

SEEDS = 2**31  # those that --seed takes


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
    entries = _entries(randomization, config, meshes, environments)
    _check(randomization.name, entries, config)
    return tuple(_scene(entries, config, number) for number in range(count))


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


def _entries(
    randomization: Randomization,
    config: SimulateConfig,
    meshes: Sequence[Path],
    environments: Sequence[Path],
) -> dict[str, Distribution]:
    given = changed_names(config, SimulateConfig())
    entries = {key: entry for key, entry in randomization.entries.items() if key not in given}
    for key, files in (("mesh", meshes), ("environment", environments)):
        if files:
            entries[key] = Choice.even(*files)
    if config.scene:  # these objects and no others
        entries.pop("mesh", None)
    return entries


def _scene(entries: Mapping[str, Distribution], config: SimulateConfig, number: int) -> SceneJob:
    def share(key: str, item: int = 0) -> float:
        return share_of(config.seed, number, key, item)

    values = _meshes(entries, share)
    objects = len(values.get("scene", config.scene)) or 1  # pyright: ignore[reportArgumentType]
    for key, entry in entries.items():
        if key not in ("mesh", OBJECT_COUNT, DISTRACTOR_MESH_COUNT):
            values[key] = _draw(entry, known_keys()[key], objects, share)
    values["seed"] = int(share("seed") * SEEDS)
    drawn = {key: as_json(value) for key, value in values.items()}
    return SceneJob(f"{number:04d}", with_values(config, values), drawn)


def _meshes(entries: Mapping[str, Distribution], share: Callable[..., float]) -> dict[str, Value]:
    """Return the meshes of objects and distractors: each another one, as long as there are any."""
    if "mesh" not in entries:
        return {}
    counts = (
        _count(entries, OBJECT_COUNT, 1, share),
        _count(entries, DISTRACTOR_MESH_COUNT, 0, share),
    )
    left, chosen = entries["mesh"], []
    for item in range(sum(counts)):
        chosen.append(left.at(share("mesh", item)))
        left = left.without(chosen[-1]) if isinstance(left, Choice) else left
    objects, others = chosen[: counts[0]], chosen[counts[0] :]
    found: dict[str, Value] = {"distractor_meshes": tuple(others)} if others else {}
    return {**found, **({"mesh": objects[0]} if len(objects) == 1 else {"scene": tuple(objects)})}


def _count(
    entries: Mapping[str, Distribution], key: str, usual: int, share: Callable[..., float]
) -> int:
    value = entries[key].at(share(key)) if key in entries else usual
    assert isinstance(value, int)
    return value


def _draw(entry: Distribution, key: Key, objects: int, share: Callable[..., float]) -> Value:
    value = entry.at(share(key.name))
    if not key.per_object or isinstance(value, tuple):
        return _listed(key, value)
    return tuple(entry.at(share(key.name, item)) for item in range(objects))  # pyright: ignore[reportReturnType]


def _listed(key: Key, value: Value) -> Value:
    """Return the value in the form of its setting: a number for a list becomes a list of one."""
    is_single = not isinstance(value, tuple) and value is not None
    return (value,) if is_single and key.is_list else value  # pyright: ignore[reportReturnType]


def _check(name: str, entries: Mapping[str, Distribution], config: SimulateConfig) -> None:
    """Try the extremes of every distribution, beside the first value of all others."""
    known = known_keys()
    first = {key: _listed(known[key], entry.extremes[0]) for key, entry in entries.items()}
    for key, entry in entries.items():
        for value in entry.extremes:
            try:
                _check_count(key, value, entries)
                _try(with_values(config, {**first, key: _listed(known[key], value)}))
            except DigsError as error:
                what = "" if len(entry.extremes) == 1 else f" {entry.words}"
                raise DigsError(f"randomization '{name}': {key}{what}: {error}") from error


def _check_count(key: str, value: Value, entries: Mapping[str, Distribution]) -> None:
    least = {OBJECT_COUNT: 1, DISTRACTOR_MESH_COUNT: 0}.get(key)
    if least is None:
        return
    if not isinstance(value, int) or not least <= value <= MOST_OBJECTS:
        raise DigsError(f"{value}, expected {least} to {MOST_OBJECTS}")
    if value > least and "mesh" in entries and None in entries["mesh"].extremes:
        raise DigsError(
            f"{value} meshes, but 'mesh' can be the built-in object, which stands alone; leave it out there"
        )


def _try(config: SimulateConfig) -> None:
    """Raise a `DigsError` for what the settings name and does not exist."""
    from digs_warp.sim.record.inputs import rig_of
    from digs_warp.sim.record.sensor_plan import check_effects

    check_effects(config)
    rig_of(config)
    for path in (config.mesh, config.environment):
        if path is not None and not path.is_file():
            raise DigsError(f"'{path}': no such file")
