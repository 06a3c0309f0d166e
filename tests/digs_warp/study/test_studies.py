"""The studies: cases that differ, and one study end to end."""

import shlex
from pathlib import Path

import pytest

from digs_warp.checks import DigsError
from digs_warp.cli import main
from digs_warp.engines.task import RESULTS
from digs_warp.pipeline.reconstruct import ReconstructConfig
from digs_warp.sim.config import SimulateConfig
from digs_warp.study.catalogue import STUDIES, Study, find_study
from digs_warp.study.engine.case import Case, with_settings
from digs_warp.study.engine.scores import OTHER_SIZES
from digs_warp.study.engine.store import Store
from digs_warp.study.page import write_pages
from reference.study_records import record_of


@pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.name)
def test_cases_differ_and_their_settings_are_accepted(study: Study) -> None:
    cases = study.cases(2, 2, 300)
    assert len({case.key for case in cases}) == len(cases) >= 10
    for case in cases:
        with_settings(SimulateConfig(), case.recording)
        config = with_settings(ReconstructConfig(), case.reconstruction)
        if case.labels.get("knob") != "iterations":
            assert config.train.stop.iterations == 300


SMALL = {"frames": 6, "width": 96, "height": 54, "samples_per_pixel": 1, "tier": "law"}


@pytest.mark.long
def test_cases_are_measured_once_and_reported(tmp_path: Path) -> None:
    """With a recording so small that only the machinery is tested."""
    labels = {"object": "vase", "effect": "none", "strength": 0.0, "strategy": "highdepth"}
    settings = {"init.voxel_size": 0.02, "train.stop.iterations": 4, "test_every": 3}
    cases = [Case(labels | {"seed": s}, SMALL, settings | {"train.seed": s}) for s in (0, 1)]
    out = tmp_path / "out"
    study = find_study("robustness")
    assert study.run(cases, out).startswith("2 cases measured")
    before = (out / RESULTS).read_bytes()
    assert "2 were there before" in study.run(cases, out)
    assert (out / RESULTS).read_bytes() == before
    assert not list((out / "work").iterdir())
    assert study.title in (out / "report.md").read_text()
    with pytest.raises(DigsError, match="holds no study"):
        study.run(cases, out / "plots")
    measured = Store(out).finished()[0]
    assert measured["yardstick"]["psnr_object"] > 5
    for size in OTHER_SIZES:
        assert measured["yardstick"][f"psnr_object_in_place_{size}"] > 5
    assert 0 < measured["yardstick"]["depth_mae"] < 0.2
    assert 0 < measured["yardstick"]["depth_seen"] <= 1
    assert 0 < measured["surface"]["points"]["chamfer"] < 0.2
    assert measured["memory_mb"] > 100
    assert measured["course"][-1]["iteration"] == 4
    assert measured["seconds"]["train"] > 0


@pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.name)
def test_a_report_is_drawn_from_some_or_all_records(study: Study, tmp_path: Path) -> None:
    records = [record_of(case, number) for number, case in enumerate(study.cases(1, 1, 1000))]
    for count in (1, len(records)):
        page = write_pages(study.title, "", study.sections(records[:count]), tmp_path / str(count))
        assert page.stat().st_size > 3000
    tables = [table for section in study.sections(records) for table in section.tables]
    assert tables and all(len(row) == len(t.headings) for t in tables for row in t.rows)
    assert any(table.rows for table in tables)


def test_a_knob_is_priced_on_the_objects_that_both_settings_have() -> None:
    """The second object is easier, and slower by a busier machine; a budget has cut off its knobs."""
    records, measured = [], record_of(find_study("tradeoff").cases(1, 1, 1000)[0], 0)
    for name, better, slowness in (("mug", 0.0, 1.0), ("boot", 10.0, 3.0)):
        for knob, value, seconds, gain in (("usual", "", 10.0, 0.0), ("iterations", 100, 5.0, 1.5)):
            if name == "boot" and knob != "usual":
                continue
            records.append(
                measured
                | {
                    "labels": {"object": name, "knob": knob, "value": value, "seed": 0},
                    "seconds": {"train": slowness * seconds, "compile kernels": 99.0},
                    "recording_seconds": {},
                    "yardstick": {"psnr_object_in_place": 20.0 + better + gain},
                }
            )
    sections = {section.title: section for section in find_study("tradeoff").sections(records)}
    usual, row = sections["Each setting alone"].tables[0].rows
    assert usual[:4] == ["iterations", "500 (usual)", "20.0 ± 0.0", "25.00 ± 0.00"]
    assert row == ["iterations", "100", "10.0", "26.50", "", "-10.0", "+1.50"]


@pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.name)
def test_pages_have_a_column_at_twice_the_size_and_older_records_a_blank(study: Study) -> None:
    old = [record_of(case, number) for number, case in enumerate(study.cases(1, 1, 1000))]
    sizes = {"psnr_object_in_place_half": 21.0, "psnr_object_in_place_double": 23.25}
    new = [record | {"yardstick": record["yardstick"] | sizes} for record in old]
    for records, shown in ((old, {""}), (new, {"23.25"})):
        tables = [table for section in study.sections(records) for table in section.tables]
        tables = [t for t in tables if t.name in ("end", "strategies", "effects", "front")]
        assert tables
        for table in tables:
            column = table.headings.index("at twice the size [dB]")
            assert {row[column].split(" ±")[0] for row in table.rows} == shown


def test_meshes_of_ones_own_are_the_objects(tmp_path: Path) -> None:
    mug = tmp_path / "mug.glb"
    cases = find_study("robustness").cases(3, 1, 300, [mug])
    assert {case.labels["object"] for case in cases} == {"mug"}
    assert {case.recording["mesh"] for case in cases} == {mug}
    with pytest.raises(DigsError, match="two files with the same name"):
        find_study("robustness").cases(3, 1, 300, [mug, tmp_path / "other/mug.obj"])


def test_all_studies_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == [study.name for study in STUDIES]


def test_a_budget_that_fits_nothing_and_an_interruption_say_how_to_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["study", "run", "tradeoff", "--time-budget", "0.0000001s", "--out", str(tmp_path)]
    assert main(arguments) == 1
    error = capsys.readouterr().err
    assert "no case ended well: there are none" in error and "digs-warp study run trade" in error

    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("digs_warp.study.engine.runner.run_cases", interrupt)
    assert main(arguments) == 130
    last_line = capsys.readouterr().err.splitlines()[-1]
    assert last_line.endswith(shlex.join(["digs-warp", *arguments]))


def test_unknown_studies_and_numbers_are_refused() -> None:
    flags = ("--workers", "0"), ("--time-budget", "0s"), ("--time-budget", "soon")
    of_run = (["run", "tradeoff", *flag] for flag in flags)
    for arguments in (["draw"], ["run", "nothing"], ["report", "nothing"], *of_run):
        assert main(["study", *arguments]) == 2, arguments
