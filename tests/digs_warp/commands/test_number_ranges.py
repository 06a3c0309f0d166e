"""Every setting with a number states its range in its annotation, and refuses what lies outside."""

from collections.abc import Iterator
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import Any, get_args

import pytest

from digs_warp.checks import DigsError
from digs_warp.commands.command import COMMANDS, Command, Group, Node
from digs_warp.commands.settings_file import alternatives
from digs_warp.settings import NO_FLAG, Range
from digs_warp.sim.testing.recording import RecordingConfig

# What fills the fields that have no default.
REQUIRED = {int: 1, float: 1.0, str: "x", Path: Path("x")}


def commands(node: Node) -> Iterator[type[Command]]:
    if isinstance(node, Group):
        for member in node.members.values():
            yield from commands(member)
    else:
        yield node


def with_those_within(kind: type) -> Iterator[type]:
    """A dataclass of settings, and those of its fields."""
    yield kind
    for field in fields(kind):
        for inner in alternatives(field.type):
            if isinstance(inner, type) and is_dataclass(inner):
                yield from with_those_within(inner)


def has_numbers(annotation: Any) -> bool:
    kinds = alternatives(annotation)
    return bool({int, float} & {*kinds, *(part for kind in kinds for part in get_args(kind))})


def range_of(annotation: Any) -> Range:
    return next(note for note in annotation.__metadata__ if isinstance(note, Range))


def made(kind: Any, **settings: Any) -> Any:
    """The dataclass with these settings."""
    values = {}
    for field in fields(kind):
        if field.default is MISSING and field.default_factory is MISSING:
            first = alternatives(field.type)[0]
            within = made(first) if is_dataclass(first) else REQUIRED.get(first)
            values[field.name] = (Path("x"),) if get_args(first) else within
    return kind(**(values | settings))


ALL = sorted(
    {
        kind
        for each in (*commands(COMMANDS), RecordingConfig)
        for kind in with_those_within(each)
        if any(has_numbers(field.type) for field in fields(kind))
    },
    key=lambda kind: kind.__name__,
)


def test_every_number_has_a_range_and_is_refused_by_name_outside() -> None:
    assert {"SimulateConfig", "_TrainOptions", "Stop"} <= {kind.__name__ for kind in ALL}
    for kind in ALL:
        for field in fields(kind):
            if not has_numbers(field.type):
                continue
            ends = range_of(field.type)
            notes = field.type.__metadata__  # pyright: ignore
            names = [note.name for note in notes if getattr(note, "name", None)]
            flag = f"--{(names or [field.name])[0].replace('_', '-')}"
            name = field.name if NO_FLAG in notes else flag
            parts = get_args(alternatives(field.type)[0])
            for bad in (float("nan"), ends.low - 1, ends.high * 2):
                value = (bad,) * (1 if ... in parts else len(parts)) if parts else bad
                with pytest.raises(DigsError) as error:
                    made(kind, **{field.name: value})
                assert str(error.value).startswith(f"{name}: {bad!r}, expected "), field.name


def test_the_ends_pass_and_the_message_shows_them() -> None:
    for ends, good, bad, message in [
        (Range(1, 8192), (1, 8192, None), 100_000, "--x: 100000, expected 1 to 8,192"),
        (Range(0, 100), (0, 100.0), 1e9, "--x: 1000000000.0, expected 0 to 100"),
        (Range(1e-6, 100), (1e-6,), float("nan"), "--x: nan, expected 1e-06 to 100"),
        (Range(0, 0.5, "s"), (0, 0.5), 33, "--x: 33, expected 0 to 0.5 s"),
        (Range(0, 1), (0,), 10**400, f"--x: {10**400}, expected 0 to 1"),
    ]:
        for value in good:
            ends.check("--x", value)
        with pytest.raises(DigsError) as error:
            ends.check("--x", bad)
        assert str(error.value) == message
