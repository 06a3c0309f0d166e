"""Randomization files: what they may say, and what the messages say about the rest."""

from pathlib import Path

import pytest

from digs_warp.checks import DigsError
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.randomize.distributions import (
    Choice,
    Distribution,
    Normal,
    Span,
)
from digs_warp.sim.record.randomize.draws import draw_scenes
from digs_warp.sim.record.randomize.settings_file import SHIPPED, Entry, Key, load_randomization


def read(folder: Path, text: str) -> dict[str, Distribution]:
    path = folder / "mine.yaml"
    path.write_text(f"base: nothing\n{text}\n")
    return dict(load_randomization(path).entries)


@pytest.mark.parametrize(
    ("text", "key", "distribution"),
    [
        ("light_level: -1", "light_level", Choice.even(-1.0)),
        ("light_level: {uniform: [-1, 2]}", "light_level", Span(-1.0, 2.0)),
        ("strength: {log_uniform: [0.5, 2]}", "strength", Span(0.5, 2.0, "log_uniform")),
        ("strength: {normal: [1, 0.25]}", "strength", Normal(1.0, 0.25, 0.25, 1.75)),
        (
            "strength: {normal: [1, 0.2], limits: [0.9, 3]}",
            "strength",
            Normal(1.0, 0.2, 0.9, 3.0),
        ),
        ("width: {uniform: [64, 128]}", "width", Span(64, 128)),
        ("width: {choice: [64, null]}", "width", Choice((64, None), (1.0, 1.0))),
        (
            "profile: {choice: [d435, oak-d], weights: [3, 1]}",
            "profile",
            Choice(("d435", "oak-d"), (3.0, 1.0)),
        ),
        ("tier: law", "tier", Choice.even("law")),
        ("labels: normals", "labels", Choice.even("normals")),
        ("tint: 0.3", "tint", Choice.even((0.3,))),
        ("tint: [0.1, 0.3]", "tint", Choice.even((0.1, 0.3))),
        ("tint: {uniform: [0, 1]}", "tint", Span(0.0, 1.0)),
        ("environment: built-in", "environment", Choice.even(None)),
    ],
)
def test_entries_become_distributions(
    text: str, key: str, distribution: Distribution, tmp_path: Path
) -> None:
    assert read(tmp_path, text) == {key: distribution}


def test_a_switch_is_true_or_false(tmp_path: Path) -> None:
    """No setting is one today, but any may become one."""
    entry = Entry("mine.yaml: switch", Key("switch", "true or false"), tmp_path)
    assert entry.read(True) == Choice.even(True)
    assert entry.read({"choice": [True, False]}) == Choice((True, False), (1.0, 1.0))
    with pytest.raises(DigsError, match=r"switch: found 1, expected true or false"):
        entry.read(1)


def test_files_are_named_relative_to_the_randomization(tmp_path: Path) -> None:
    (tmp_path / "skies").mkdir()
    skies = [tmp_path / "skies" / name for name in ("day.hdr", "night.hdr")]
    for path in skies:
        path.touch()
    found = read(tmp_path, "environment: skies/*.hdr")
    assert found == {"environment": Choice.even(*skies)}
    mixed = read(tmp_path, "environment: {choice: [built-in, 'skies/*.hdr'], weights: [1, 1]}")
    assert mixed == {"environment": Choice((None, *skies), (1.0, 0.5, 0.5))}
    assert read(tmp_path, "mesh: a.glb") == {"mesh": Choice.even(tmp_path / "a.glb")}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("lihgt_level: 1", ["unknown key 'lihgt_level'", "did you mean 'light_level'"]),
        ("seed: 1", ["unknown key 'seed'"]),
        ("light_level: bright", ["light_level: found 'bright'", "expected a number"]),
        ("light_level: true", ["light_level: found True", "expected a number"]),
        ("light_level: .nan", ["light_level: found nan", "expected a number"]),
        ("light_level:", ["light_level: found None", "expected a number"]),
        ("light_level: [0, 1]", ["found [0, 1]", "a range is {uniform: [0, 1]}"]),
        ("width: 64.5", ["width: found 64.5", "expected a whole number"]),
        ("labels: 1", ["labels: found 1", "expected a text"]),
        ("tier: guidde", ["tier: found 'guidde'", "did you mean 'guided'"]),
        ("profile: 3", ["profile: found 3", "expected a text"]),
        ("environment: skies/*.hdr", ["environment: found 'skies/*.hdr'", "matches"]),
        ("mesh: 7", ["mesh: found 7", "expected the name of a file"]),
        ("strength: {unifrom: [0, 1]}", ["did you mean 'uniform'"]),
        ("strength: {}", ["found {}", "expected one of uniform, log_uniform, normal, choice"]),
        ("strength: {uniform: [0, 1], limits: [0, 1]}", ["expected uniform without 'limits'"]),
        ("strength: {uniform: [2, 1]}", ["{'uniform': [2, 1]}", "this range is empty"]),
        ("strength: {uniform: 2}", ["expected uniform: [low, high], two numbers"]),
        ("strength: {uniform: [1, 2, 3]}", ["expected uniform: [low, high], two numbers"]),
        ("strength: {uniform: [a, b]}", ["expected uniform: [low, high], two numbers"]),
        ("strength: {log_uniform: [0, 1]}", ["0 < low"]),
        ("strength: {log_uniform: [2, 1]}", ["this range is empty"]),
        ("strength: {normal: [1, 0]}", ["a standard deviation above 0"]),
        ("strength: {normal: [1, 1], limits: [1, 1]}", ["this range is empty"]),
        ("strength: {choice: []}", ["a list of one value or more"]),
        ("strength: {choice: 1}", ["a list of one value or more"]),
        ("strength: {choice: [1, x]}", ["found 'x'", "expected a number"]),
        ("strength: {choice: [1, 2], weights: [1]}", ["2 weights above 0"]),
        ("strength: {choice: [1, 2], weights: [1, 0]}", ["2 weights above 0"]),
        ("width: {uniform: [0.5, 0.8]}", ["two whole numbers"]),
        ("width: {uniform: [9, 8]}", ["this range is empty"]),
        ("width: {log_uniform: [8, 9]}", ["uniform or choice, because it is a whole number"]),
        ("tier: {uniform: [0, 1]}", ["a choice, because its values are no numbers"]),
    ],
)
def test_what_is_wrong_is_named_with_file_and_key(
    text: str, words: list[str], tmp_path: Path
) -> None:
    with pytest.raises(DigsError) as caught:
        read(tmp_path, text)
    message = str(caught.value)
    assert message.startswith(f"randomization '{tmp_path / 'mine.yaml'}'")
    assert [word for word in words if word not in message] == [], message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "strength: {uniform: [1, 200]}",
            ["strength {uniform: [1, 200]}: --error-strength: 200.0"],
        ),
        ("tint: {choice: [[0.1, 2]]}", ["tint: tint: 2.0, expected 0 to 1"]),
        ("profile: {choice: [d435, d436]}", ["profile", "'d436'", "did you mean 'd435'"]),
        ("mesh: nothing.glb", ["mesh: '", "no such file"]),
        ("effects: flying-pigs", ["effects: ", "flying-pigs"]),
    ],
)
def test_values_that_a_setting_refuses_are_found_before_the_first_scene(
    text: str, words: list[str], tmp_path: Path
) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(f"base: nothing\n{text}\n")
    with pytest.raises(DigsError, match="randomization 'mine'") as caught:
        draw_scenes(load_randomization(path), SimulateConfig(), 1)
    assert [word for word in words if word not in str(caught.value)] == [], str(caught.value)


def test_a_file_adds_to_its_base(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("light_level: 0.5\n")
    indoor = dict(load_randomization("indoor").entries)
    mine = load_randomization(tmp_path / "mine.yaml")
    assert (mine.name, dict(mine.entries)) == ("mine", {**indoor, "light_level": Choice.even(0.5)})
    (tmp_path / "mine.yaml").write_text("base: wild\n")
    assert load_randomization(tmp_path / "mine.yaml").entries == load_randomization("wild").entries
    (tmp_path / "mine.yaml").write_text("base: outdoor\n")
    with pytest.raises(DigsError, match=r"base 'outdoor', expected one of indoor"):
        load_randomization(tmp_path / "mine.yaml")


def test_ours_can_be_drawn_and_others_are_not_known() -> None:
    assert "indoor" in SHIPPED
    for name in SHIPPED:
        assert len(draw_scenes(load_randomization(name), SimulateConfig(), 3)) == 3
    with pytest.raises(DigsError, match="did you mean 'indoor'"):
        load_randomization("indor")
    with pytest.raises(DigsError, match="no such file"):
        load_randomization("somewhere/mine.yaml")
