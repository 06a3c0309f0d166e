"""Every flag with a number has a range, stated in one table, and refuses what lies outside."""

from collections.abc import Iterator
from dataclasses import is_dataclass
from itertools import chain

import pytest

from digs_warp.bounds import FLAGS, check_flag
from digs_warp.checks import DigsError
from digs_warp.commands.command import Command, Group, Node
from digs_warp.commands.common_flags import CommonFlags
from digs_warp.commands.parse import read_command
from digs_warp.commands.registry import COMMANDS
from digs_warp.commands.setting_names import alternatives, settings_of

# Has a separate range, because its message explains the unit; see its configuration.
OTHERS = {"--background", "--readout-time"}
# What a command needs to be parsed at all.
NEEDED = {
    "reconstruct": ["capture", "--out", "out"],
    "convert": ["in", "--out", "out"],
    "render": ["scene", "--out", "out.mp4"],
    "view": ["scene"],
    "report": ["folder"],
    "mesh": ["scene", "--out", "out.ply"],
    "export-usd": ["scene", "--out", "out.usd"],
    "sensor fit": ["capture", "--out", "profile.yaml"],
    "sensor wall": ["--out", "out"],
    "preference make": ["item", "--out", "out"],
    "study plan": ["--price", "1"],
    "recommend": ["--time-budget", "60s"],
}


def commands(node: Node, name: str = "") -> Iterator[tuple[str, type[Command]]]:
    """All commands by the words that call them."""
    if isinstance(node, Group):
        for word, member in node.members.items():
            yield from commands(member, f"{name} {word}".strip())
    else:
        yield name, (node if isinstance(node, type) else type(node.command))


def number_flags(kind: type) -> Iterator[tuple[str, type]]:
    """The flags of a command that hold whole numbers or numbers."""
    for name, _, hint in settings_of(kind):
        options = alternatives(hint)
        inner = next((each for each in options if is_dataclass(each)), None)
        if isinstance(inner, type):
            yield from number_flags(inner)
        for number in (int, float):
            if any(each is number or number in getattr(each, "__args__", ()) for each in options):
                yield f"--{name.replace('_', '-')}", number


ALL = sorted(
    {
        (command, flag, number)
        for command, kind in commands(COMMANDS)
        for flag, number in number_flags(kind)
    },
    key=str,
)


def test_every_flag_with_a_number_has_a_range_and_no_other():
    flags = {flag for _, flag, _ in ALL}
    assert len(ALL) > 100
    assert flags - OTHERS == set(FLAGS)


@pytest.mark.parametrize(("command", "flag", "number"), ALL, ids=str)
def test_values_out_of_range_are_refused_by_name(command: str, flag: str, number: type):
    bad = ["1e30" if number is float else str(10**30)]
    if next(each for each in ALL if each[1] == flag)[0] == command:  # others share its code
        bad += ["nan", "-1e30"] if number is float else [str(-(10**9))]
    for value in bad:
        words = [*command.split(), *NEEDED.get(command, [])]
        values = [value] * (3 if flag == "--background" else 1)
        with pytest.raises((DigsError, SystemExit)) as error:
            read_command([*words, flag, *values], CommonFlags())
        if not isinstance(error.value, SystemExit):
            assert flag in str(error.value), (value, str(error.value))


def test_the_ends_of_a_range_pass_and_the_message_shows_them():
    for flag, ends in FLAGS.items():
        for value in ends:
            check_flag(flag, value)
    with pytest.raises(DigsError, match=r"--width: 100000, expected 1 to 8,192"):
        check_flag("--width", 100_000)
    with pytest.raises(DigsError, match=r"--strength: 1000000000.0, expected 0 to 100"):
        check_flag("--strength", 1e9)
    with pytest.raises(DigsError, match=r"--voxel-size: nan, expected 1e-06 to 100"):
        check_flag("--voxel-size", float("nan"))


def test_large_real_work_is_within_the_ranges():
    for flag, value in {
        "--width": 7680,
        "--max-splats": 6_000_000,
        "--frames": 20_000,
        "--iterations": 30_000,
        "--samples-per-pixel": 1024,
        "--strength": 4,
        "--object-size": 10,
    }.items():
        check_flag(flag, value)


def test_ranges_are_in_alphabetical_order():
    assert list(FLAGS) == sorted(FLAGS)
    assert set(chain(*FLAGS.values()))  # numbers, all of them
