"""`recommend CAPTURE` and `reconstruct --recommended` on a tiny capture: the same choice, and its record."""

import json
import shlex
from pathlib import Path
from typing import Any

import pytest

from digs_warp import cli
from digs_warp.cli import main
from digs_warp.commands.reconstruct import Reconstruct
from digs_warp.study.engine.store import Store
from digs_warp.study.studies import tradeoff
from reference.study_records import record_of

# Steps of the settings of the study here; more are better.
STEPS = {"usual": 4, 100: 2, 1000: 6}


@pytest.fixture
def own_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A study of one's own that recommends few steps, and that measured next to no time."""
    monkeypatch.chdir(tmp_path)
    store = Store(tmp_path / "out" / "study" / "tradeoff")
    for case in tradeoff.cases(1, 1, 500):
        steps = STEPS.get(case.labels["value"] or case.labels["knob"])
        if steps is None or case.labels["knob"] not in ("usual", "iterations"):
            continue
        record = record_of(case, 0)
        record["reconstruction"]["train.stop.iterations"] = steps
        record["yardstick"]["psnr_object_in_place"] = 20.0 + steps
        record["seconds"] = {"initialize": 1e-3, "train": 1e-3 * steps}
        store.add(record)


def record(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "run.json").read_text())


@pytest.mark.usefixtures("own_study")
def test_reconstruct_runs_what_is_recommended(
    tmp_path: Path, capture_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capture = str(capture_folder)
    assert main(["recommend", capture, "--time-budget", "1h"]) == 0
    lines = dict(line.split("  ", 1) for line in capsys.readouterr().out.splitlines())
    assert lines["iterations"].split()[0] == "6:"
    command = cli.parse(shlex.split(lines["command"])[1:])
    assert isinstance(command, Reconstruct)
    out = tmp_path / "reconstruction"
    words = ["reconstruct", capture, "--out", str(out), "--recommended", "1h"]
    assert main(words) == 0
    assert "INFO: setting: iterations 1000: the best of 3" in capsys.readouterr().err
    found = record(out)
    assert found["results"]["iterations"] == command.train.stop.iterations == 6
    assert found["settings"]["init"]["voxel_size"] == command.init.voxel_size
    assert found["recommended"]["settings"]["init.voxel_size"] == command.init.voxel_size
    assert found["recommended"]["budget"] == 3600
    assert found["recommended"]["predicted_seconds"] > 0
    assert found["recommended"]["because"]["setting"].startswith("iterations 1000: the best of 3")
    assert main([*words, "--resume"]) == 0  # measures nothing again, and finds all done
    assert record(out)["recommended"] == found["recommended"]
    capsys.readouterr()
    assert main([*words[:-1], "2h", "--resume"]) == 1
    assert "started with --recommended 3600s, not 7200s" in capsys.readouterr().err
    plain = tmp_path / "plain"
    assert main(["reconstruct", capture, "--out", str(plain), "--iterations", "2"]) == 0
    assert "recommended" not in record(plain)
    capsys.readouterr()
    assert main([*words[:3], str(plain), *words[4:], "--resume"]) == 1
    assert "started with no --recommended, not 3600s" in capsys.readouterr().err


@pytest.mark.usefixtures("own_study")
def test_a_stated_machine_needs_no_training(
    capture_folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: object) -> float:
        raise AssertionError("trained")

    monkeypatch.setattr("digs_warp.study.recommend.look._step_seconds", never)
    words = ["recommend", str(capture_folder), "--time-budget", "1h"]
    assert main([*words, "--machine-factor", "2.5"]) == 0
    assert "2.50 times" in capsys.readouterr().out
    assert main([*words[:2], "--time-budget", "0.000001s", "--machine-factor", "1"]) == 1
    error = capsys.readouterr().err
    assert "no setting takes 1e-06 s or less; the fastest, 'iterations 100', takes about" in error


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["recommend", "--time-budget", "9s", "--machine-factor", "2"], "is for a CAPTURE"),
        (["recommend", "missing", "--time-budget", "9s"], "capture 'missing'"),
        (["reconstruct", "a", "--out", "b", "--recommended", "0s"], "expected a time"),
        (["reconstruct", "a", "b", "--out", "c", "--recommended", "9s"], "looks at one capture"),
        *(
            (["reconstruct", "a", "--out", "b", "--recommended", "9s", *flag], f"chooses {flag[0]}")
            for flag in (
                ("--iterations", "7"),
                ("--voxel-size", "0.01"),
                ("--strategy", "random"),
                ("--density", "mcmc"),
                ("--target-points", "9"),
            )
        ),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_contradicts_itself_is_refused(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) != 0
    assert message in " ".join(capsys.readouterr().err.split())
