"""Every setting with a number states its range in its annotation, and refuses what lies outside."""

import inspect
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any, get_args

import pytest

from digs_warp.checks import DigsError
from digs_warp.commands.command import COMMANDS, Command, Group, Node
from digs_warp.commands.settings_file import alternatives
from digs_warp.settings import Range, Settings
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.scene.appearance import LookSettings
from digs_warp.sim.testing.recording import RecordingConfig
from digs_warp.train.config import TrainConfig


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


ALL = sorted(
    {
        kind
        for each in (*commands(COMMANDS), RecordingConfig)
        for kind in with_those_within(each)
        if any(has_numbers(field.type) for field in fields(kind))
    },
    key=lambda kind: kind.__name__,
)


def test_every_number_has_a_range_that_its_settings_keep() -> None:
    assert {"SimulateConfig", "_TrainOptions", "Stop"} <= {kind.__name__ for kind in ALL}
    for kind in ALL:
        numbers = [field for field in fields(kind) if has_numbers(field.type)]
        assert all(range_of(field.type) for field in numbers) and issubclass(kind, Settings)
        if "__post_init__" in vars(kind):  # which is to call that of `Settings`
            assert "super().__post_init__()" in inspect.getsource(kind), kind


def test_a_number_out_of_its_range_is_refused_by_the_name_of_its_flag_or_setting() -> None:
    for make, message in [
        (lambda: SimulateConfig(strength=-1), "--error-strength: -1, expected 0 to 100"),
        (lambda: SimulateConfig(object_turn=float("nan")), "object_turn: nan, expected -360"),
        (lambda: TrainConfig(learning_rate=0.0), "learning_rate: 0.0, expected 1e-12 to"),
        (lambda: LookSettings(tint=(0.5, -3.0)), "tint: -3.0, expected"),
    ]:
        with pytest.raises(DigsError, match=f"^{message}"):
            make()


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
