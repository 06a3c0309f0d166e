"""The command line: exit codes, messages, and the rules that protect what lies in the output folder."""

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import is_dataclass
from itertools import product
from pathlib import Path
from typing import Any, get_type_hints

import pytest
import warp as wp

from digs_warp.api.keywords import ReconstructSettings, SimulateSettings
from digs_warp.cli import EXIT_BAD_INPUT, EXIT_INTERRUPTED, EXIT_WRONG_USAGE, main
from digs_warp.commands.command import COMMANDS, Places
from digs_warp.commands.parse import about
from digs_warp.commands.reconstruction_options import ReconstructionOptions
from digs_warp.commands.settings_file import alternatives, settings_of
from digs_warp.commands.simulate import Simulate
from digs_warp.record.run_log import RunLog
from digs_warp.sim.config import SimulateConfig
from reference.splat_scenes import random_gaussians


def our_folder(path: Path) -> Path:
    """A folder as an earlier run left it."""
    RunLog("simulate", {"frames": 3}).save(path / "run.json")
    (path / "old.txt").write_text("from an earlier run")
    return path


# Usage


@pytest.mark.parametrize(
    ("typed", "options", "arguments"),
    [
        (ReconstructSettings, ReconstructionOptions, {"strategy", "iterations"}),
        (SimulateSettings, SimulateConfig, {"mesh", "frames"}),
    ],
)
def test_editors_know_the_keywords_and_their_types(
    typed: type, options: type, arguments: set[str]
) -> None:
    """Of the settings, but those that the functions of digs_warp/api/keywords.py name themselves."""
    wanted = {name: set(map(str, alternatives(hint))) for name, hint in flat_settings(options)}
    for name in arguments:
        del wanted[name]
    found = {
        name: set(map(str, alternatives(hint))) - {"<class 'str'>"}
        | wanted[name] & {"<class 'str'>"}
        for name, hint in get_type_hints(typed).items()
    }
    assert found == wanted


def flat_settings(kind: type) -> Iterator[tuple[str, Any]]:
    for name, _, hint in settings_of(kind):
        inner = next((each for each in alternatives(hint) if is_dataclass(each)), None)
        yield from flat_settings(inner) if isinstance(inner, type) else [(name, hint)]


def test_wrong_usage_exits_with_2_and_says_something(capsys: pytest.CaptureFixture[str]) -> None:
    of_simulate = (
        "--frames many",
        "--frames 0",
        "--tier perfect",
        "--resume --overwrite",
        "--quiet --verbose",
    )
    lines = ["", "nonsense", "info", "info x --nonsense", "study run nonsense", "study"]
    for line in [*lines, *(f"simulate --out x {flags}" for flags in of_simulate)]:
        assert main(line.split()) == EXIT_WRONG_USAGE, line
        captured = capsys.readouterr()
        assert captured.out == "" and captured.err.strip()


# Bad input


def test_missing_and_unusable_files_exit_with_1_and_a_message_that_names_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, missing = tmp_path / "out", tmp_path / "missing"
    broken = [tmp_path / f"broken.{suffix}" for suffix in ("blend", "npz", "usdz", "glb")]
    for path in broken:
        path.write_bytes(b"PK\x03\x04 not what it seems")
    for path, *arguments in (
        *((path, "info", str(path)) for path in broken),
        (missing, "info", str(missing)),
        (missing, "info", f"{missing}.npz"),
        (missing, "export-usd", str(missing), "--out", f"{out}.usdz"),
        (missing, "simulate", "--mesh", f"{missing}.glb", "--out", str(out)),
        (missing, "simulate", "--environment", f"{missing}.hdr", "--out", str(out)),
    ):
        assert main(arguments) == EXIT_BAD_INPUT
        captured = capsys.readouterr()
        assert str(path) in captured.err and "Traceback" not in captured.err
        assert captured.out == ""


def test_a_device_that_is_not_there_is_refused_before_anything_else(
    capture_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = our_folder(tmp_path / "out")
    devices = ["foo", "cuda:77", "", *(() if wp.get_cuda_device_count() else ("cuda",))]
    commands = (["run"], ["reconstruct", str(capture_folder)])
    for device, command in product(devices, commands):
        words = [*command, "--out", str(out), "--overwrite", "--device", device]
        assert main(words) == EXIT_BAD_INPUT
        error = capsys.readouterr().err
        assert f"--device: '{device}', which Warp does not find" in error
        assert "expected one of cpu" in error and len(error.splitlines()) == 1
    assert (out / "old.txt").exists()


# The process


def test_info_on_an_interrupted_run_says_how_to_go_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["info", str(our_folder(tmp_path / "out"))]) == EXIT_BAD_INPUT
    assert "--resume" in capsys.readouterr().err


def test_an_interrupted_command_says_how_to_go_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(_: Simulate) -> str:
        raise KeyboardInterrupt

    monkeypatch.setattr(Simulate, "execute", interrupted)
    out = str(tmp_path / "my capture")
    assert main(["simulate", "--overwrite", "--out", out]) == EXIT_INTERRUPTED
    assert capsys.readouterr().err.endswith(f"digs-warp simulate --out '{out}' --resume\n")


@pytest.mark.parametrize("arguments", [["study", "--help"], ["--version-of-nothing"]])
def test_a_reader_that_goes_away_is_no_error_to_talk_about(arguments: list[str]):
    program = "import sys; from digs_warp.cli import main; sys.exit(main())"
    reading, writing = os.pipe()
    os.close(reading)  # as `| head` does after its lines
    with os.fdopen(writing, "wb") as stdout:
        result = subprocess.run(
            [sys.executable, "-c", program, *arguments],
            stdout=stdout,
            stderr=subprocess.PIPE,
            check=False,
        )
    if "--help" in arguments:
        assert (result.returncode, result.stderr) == (141, b"")
    else:  # what goes to stderr still arrives
        assert result.returncode == 2
        assert b"--version-of-nothing" in result.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize(
    ("arguments", "buffered"), [(["--help"], True), (["info", "{capture}"], False)]
)
def test_output_to_a_full_disk_is_an_error_in_one_line(
    arguments: list[str], buffered: bool, capture_folder: Path
) -> None:
    flags = [] if buffered else ["-u"]
    words = [each.format(capture=capture_folder) for each in arguments]
    with open("/dev/full", "w") as full:
        result = subprocess.run(
            [sys.executable, *flags, "-m", "digs_warp", *words],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            env={name: each for name, each in os.environ.items() if name != "PYTHONUNBUFFERED"},
            check=False,
        )
    assert result.returncode == EXIT_BAD_INPUT
    (line,) = result.stderr.splitlines()
    assert "could not be written: No space left on device" in line


@pytest.mark.parametrize(
    ("locale", "closed"), [("C.UTF-8", ""), ("C", ""), ("C", ">&-"), ("C", "2>&-")]
)
def test_names_that_are_no_text_an_ascii_locale_and_closed_streams(
    tmp_path: Path, locale: str, closed: str
) -> None:
    source = tmp_path / os.fsdecode(b"caf\xe9.ply")
    random_gaussians(3, seed=1).save(source)
    for suffix, code in ((".spz", 0), (".usda", 1)):  # OpenUSD takes no such names
        command = [sys.executable, "-m", "digs_warp", "convert", source, "--out"]
        result = subprocess.run(
            ["sh", "-c", f'"$@" {closed}', "sh", *command, source.with_suffix(suffix)],
            env=os.environ | {"LC_ALL": locale, "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
            capture_output=True,
            check=False,
        )
        lines = result.stderr.splitlines()
        assert (result.returncode, len(lines)) == (code, code if closed != "2>&-" else 0), lines


def test_the_list_of_commands_says_what_they_say() -> None:
    places = COMMANDS.members
    assert isinstance(places, Places)
    listed = {name: places.about(name) for name in places}
    assert listed == {name: about(places[name]).partition("\n")[0] for name in places}
