"""--config: the settings of an earlier run as defaults; each number has a range in its annotation."""

import inspect
import os
import re
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, get_args

import pytest

from digs_warp import cli
from digs_warp.checks import DigsError
from digs_warp.cli import EXIT_WRONG_USAGE, main
from digs_warp.commands.command import COMMANDS, Command, Group, Node
from digs_warp.commands.reconstruct import Reconstruct
from digs_warp.commands.run import Run
from digs_warp.commands.settings_file import alternatives, file_settings
from digs_warp.commands.simulate import Simulate
from digs_warp.record.run_log import RunLog
from digs_warp.settings import Range, Settings
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.scene.appearance import LookSettings
from digs_warp.sim.testing.recording import RecordingConfig
from digs_warp.train.config import TrainConfig

RECORDING = [
    *("--frames", "7", "--mesh", "a b.glb", "--error-strength", "0.1", "--seed", "3"),
    *("--labels", "normals"),
]
RECONSTRUCTION = [
    *("--poses", "sfm", "--refine-focal", "--strategy", "fusion", "--voxel-size", "0.0037"),
    *("--iterations", "12", "--time-budget", "3min", "--density", "adaptive"),
    *("--test-every", "4", "--masks", "folder", "--mask-folder", "m"),
]


def save(path: Path, command: str, settings: Any) -> Path:
    RunLog(command, settings).save(path)
    return path


def settings_of(command: object) -> Any:
    """What the command writes into its run.json."""
    if isinstance(command, Run):
        config = command.reconstruct_config(command.recording.seed)
        return {"recording": command.recording, "reconstruction": config}
    if isinstance(command, Reconstruct):
        return command.reconstruct_config(command.seed)
    assert isinstance(command, Simulate)
    is_one = not command.many.asked_for
    return command.recording if is_one else {"recording": command.recording, "scenes": command.many}


def test_files_are_found_from_another_folder(tmp_path: Path, monkeypatch) -> None:
    project = tmp_path / "project"
    (project / "out").mkdir(parents=True)
    (project / "a b.glb").write_text("")
    endless = f"{'x' * 5000}.glb"  # no system has such names
    command = cli.parse(["simulate", "--out", "x", "--scene", "a b.glb", endless])
    config = save(project / "out/run.json", "simulate", settings_of(command))
    monkeypatch.chdir(tmp_path)
    again = cli.parse(["simulate", "--out", "y", "--config", str(config)])
    assert isinstance(again, Simulate)
    assert again.recording.scene == (project / "a b.glb", Path(endless))
    monkeypatch.chdir(project)
    again = cli.parse(["simulate", "--out", "y", "--config", "out/run.json"])
    assert settings_of(again) == settings_of(command)


def test_settings_come_back_identical(tmp_path: Path) -> None:
    for name, source, flags in [
        ("run", [], [*RECORDING, *RECONSTRUCTION]),
        ("run", [], []),
        ("reconstruct", ["capture"], ["--seed", "9", *RECONSTRUCTION]),
        ("simulate", [], RECORDING),
        ("simulate", [], ["--meshes", "*.glb", "--trajectories", "2", "--frames", "3"]),
    ]:
        first = cli.parse([name, *source, "--out", "a", *flags])
        record = save(tmp_path / "run.json", name, settings_of(first))
        second = cli.parse([name, *source, "--config", str(record), "--out", "b"])
        assert settings_of(second) == settings_of(first)
        assert second != first  # the folder


def test_flags_override_the_file(tmp_path: Path) -> None:
    first = cli.parse(["run", "--out", "a", *RECORDING, *RECONSTRUCTION])
    record = save(tmp_path / "run.json", "run", settings_of(first))
    flags = ["--frames", "9", "--strategy", "depth", "--no-refine-focal"]
    command = cli.parse(["--config", str(record), "run", "--out", "b", *flags])
    assert isinstance(command, Run)
    assert (command.recording.frames, command.recording.strength) == (9, 0.1)
    assert (command.init.strategy, command.sfm.refine_focal) == ("depth", False)


WITHOUT_FLAG = """
settings:
  recording: {look: {tint: [0.2]}}
  reconstruction: {init: {edge_filter: false}, train: {learning_rate: 1e-5, evaluate_at: [3, 5]}}
"""


def test_settings_without_a_flag_come_from_the_file_and_are_checked(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(WITHOUT_FLAG)
    command = cli.parse(["run", "--config", str(path), "--out", "x", "--depth-weight", "0.1"])
    assert isinstance(command, Run)
    config = command.reconstruct_config(0)
    assert (command.recording.look.tint, command.recording.tier) == ((0.2,), "guided")
    assert (config.init.edge_filter, config.train.learning_rate) == (False, 1e-5)
    assert (config.train.evaluate_at, config.train.depth_weight) == ((3, 5), 0.1)
    path.write_text(WITHOUT_FLAG.replace("1e-5", "-1.0"))
    with pytest.raises(
        DigsError, match=r"mine.yaml': learning_rate: -1.0, expected 1e-12 to 1,000"
    ):
        cli.parse(["run", "--config", str(path), "--out", "x"])


def test_the_documentation_lists_the_settings_without_a_flag() -> None:
    page = (Path(__file__).parents[3] / "docs/command-line.md").read_text()
    listed = {
        f"{where}.{name}"
        for where, names in re.findall(r"^- `([a-z.]+)`: (`.*`)$", page, re.MULTILINE)
        for name in re.findall("`([a-z_]+)`", names)
    }
    assert listed == set(file_settings(Run.recorded).values())


def test_settings_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    for command, settings, message in [
        ("simulate", {"frames": 3}, "settings of 'digs-warp simulate'.*'digs-warp run'"),
        ("run", {"recording": {"framse": 3}}, "unknown setting 'framse'.*frames"),
        ("run", {"recordings": {}}, "unknown setting 'recordings'"),
        (
            "run",
            {"recording": {"frames": "many"}},
            "recording: frames is 'many', expected a whole number",
        ),
        ("run", {"recording": {"tier": "x"}}, "recording: tier is 'x', expected one of truth, law"),
        ("run", {"recording": {"frames": 0}}, "frames"),
    ]:
        path = save(tmp_path / "run.json", command, settings)
        with pytest.raises(DigsError, match=message):
            cli.parse(["run", "--config", str(path), "--out", "x"])


UNUSABLE = {
    "empty.json": "{}",
    "nothing.yaml": "settings:\n",
    "list.yaml": "[1]",
    "broken.yaml": "settings:\n  ? [a, b]\n  : 1\n",
    "deep.yaml": "settings: " + "{a: " * 3000 + "1" + "}" * 3000,
    "cyclic.yaml": "settings: &all {recording: {frames: [*all]}}\n",
    "digits.yaml": f"settings: {{recording: {{frames: {'9' * 5000}}}}}\n",
}


def test_unusable_files_are_explained_in_one_line(tmp_path: Path, capsys) -> None:
    for file, text in UNUSABLE.items():
        (tmp_path / file).write_text(text)
    os.mkfifo(tmp_path / "pipe.yaml")
    for name in ("missing.json", "pipe.yaml", *UNUSABLE):
        assert main(["run", "--config", str(tmp_path / name)]) == EXIT_WRONG_USAGE
        error = capsys.readouterr().err
        assert name in error and len(error.splitlines()) == 1, error


def all_commands(node: Node) -> Iterator[type[Command]]:
    if isinstance(node, Group):
        for member in node.members.values():
            yield from all_commands(member)
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


NUMBERED = sorted(
    {
        kind
        for each in (*all_commands(COMMANDS), RecordingConfig)
        for kind in with_those_within(each)
        if any(has_numbers(field.type) for field in fields(kind))
    },
    key=lambda kind: kind.__name__,
)


def test_every_number_has_a_range_that_its_settings_keep() -> None:
    assert {"SimulateConfig", "_TrainOptions", "Stop"} <= {kind.__name__ for kind in NUMBERED}
    for kind in NUMBERED:
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
