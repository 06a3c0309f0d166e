"""The studies: cases that differ, and one study end to end."""

import json
import shlex
from pathlib import Path

import pytest

from digs_warp.cli import main
from digs_warp.engines.task import RESULTS
from digs_warp.pipeline.reconstruct import ReconstructConfig
from digs_warp.sim.config import SimulateConfig
from digs_warp.study.catalogue import STUDIES, Study
from digs_warp.study.engine.case import Case, with_settings

BY_NAME = {study.name: study for study in STUDIES}


@pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.name)
def test_cases_differ_and_their_settings_are_accepted(study: Study) -> None:
    cases = study.cases(2, 2, 300)
    assert len({case.key for case in cases}) == len(cases) > 10
    for case in cases:
        if case.real is None:
            with_settings(SimulateConfig(), case.recording)
        config = with_settings(ReconstructConfig(), case.reconstruction)
        if case.labels.get("knob") != "iterations" and case.effort == 1:
            assert config.train.stop.iterations == 300


def test_a_study_is_measured_resumed_and_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Segmentation, with a recording so small that only the machinery is tested."""
    from digs_warp.study.studies import segmentation

    def few(objects_count: int, seeds: int, iterations: int) -> list[Case]:
        return [
            Case(
                {"object": "vase", "mask error": error, "strategy": "highdepth", "seed": 0},
                {"frames": 6, "width": 96, "height": 54, "samples_per_pixel": 1, "tier": "law"},
                {"segment.masks": "degraded", "segment.mask_error": error}
                | {"init.voxel_size": 0.02, "train.stop.iterations": iterations, "test_every": 3},
            )
            for error in (0.0, 2.0)
        ]

    monkeypatch.setattr(segmentation, "cases", few)
    out = tmp_path / "out"
    assert main(["study", "run", "segmentation", "--out", str(out), "--iterations", "4"]) == 0
    assert "2 cases measured" in capsys.readouterr().out
    records = [json.loads(line) for line in (out / RESULTS).read_text().splitlines()]
    for record in records:
        assert record["yardstick"]["psnr_object"] > 5
        assert 0 < record["yardstick"]["depth_mae"] < 0.2
        assert 0 < record["yardstick"]["depth_seen"] <= 1
        assert 0 < record["surface"]["points"]["chamfer"] < 0.2
        assert record["memory_mb"] > 100
        assert record["course"][-1]["iteration"] == 4
        assert record["seconds"]["train"] > 0
    assert not list((out / "work").iterdir())
    before = (out / RESULTS).read_bytes()
    assert main(["study", "run", "segmentation", "--out", str(out), "--iterations", "4"]) == 0
    assert "2 were there before" in capsys.readouterr().out
    assert (out / RESULTS).read_bytes() == before
    assert "Wrong masks" in (out / "report.md").read_text()


def test_all_studies_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == [study.name for study in STUDIES]


def test_a_budget_leaves_out_cases(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing fits into a tenth of a microsecond: the folder stays empty, and the report says so."""
    arguments = ["study", "run", "segmentation", "--time-budget", "0.0000001s"]
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 1
    assert "no case ended well: there are none" in capsys.readouterr().err


def test_an_interrupted_study_says_how_to_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("digs_warp.study.engine.runner.run_cases", interrupt)
    arguments = ["study", "run", "segmentation", "--out", str(tmp_path)]
    assert main(arguments) == 130
    last_line = capsys.readouterr().err.splitlines()[-1]
    assert last_line.endswith(shlex.join(["digs-warp", *arguments]))


@pytest.mark.parametrize(
    "arguments",
    [
        *(["run", "nothing"], ["report", "nothing"], ["run", "tradeoff", "--workers", "0"]),
        *(
            ["run", "tradeoff", "--time-budget", "0s"],
            ["run", "tradeoff", "--time-budget", "soon"],
            ["draw"],
        ),
    ],
)
def test_unknown_studies_and_numbers_are_refused(arguments: list[str]) -> None:
    assert main(["study", *arguments]) == 2


def test_a_report_of_nothing_says_what_to_measure(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "report", "tradeoff", "--out", "/nonexistent"]) == 1
    assert "digs-warp study run tradeoff" in capsys.readouterr().err
