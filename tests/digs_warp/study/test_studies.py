"""The studies: cases that differ, one study end to end, and pages that hold the same numbers."""

import csv
import io
import json
import re
import shlex
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest
from PIL import Image

from digs_warp.checks import DigsError
from digs_warp.cli import main
from digs_warp.data.images import read_image
from digs_warp.engines.task import RESULTS
from digs_warp.pipeline.reconstruct import ReconstructConfig
from digs_warp.record.files import write_atomically
from digs_warp.sim.config import SimulateConfig
from digs_warp.study.catalogue import STUDIES, Study, find_study
from digs_warp.study.charts import Chart, Curve
from digs_warp.study.engine import chain
from digs_warp.study.engine.case import Case, with_settings
from digs_warp.study.engine.scores import OTHER_SIZES
from digs_warp.study.engine.store import Store
from digs_warp.study.page import Section, write_pages
from digs_warp.study.table import Table
from reference.study_records import record_of

IN_PLACE = "psnr_object_in_place"


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
    for size in ("", *(f"_{size}" for size in OTHER_SIZES)):
        assert measured["yardstick"][f"psnr_object_in_place{size}"] > 5
    assert 0 < measured["yardstick"]["depth_mae"] < 0.2
    assert 0 < measured["surface"]["points"]["chamfer"] < 0.2
    assert measured["course"][-1]["iteration"] == 4
    assert measured["seconds"]["train"] > 0


def test_the_next_case_takes_the_matches_of_the_first(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Poses are refined after the matching, so that cases with and without it share theirs."""
    matched = []

    def reconstruct(capture: Any, config: ReconstructConfig, work: Path) -> Any:
        model = work / "sfm/model"
        if not model.is_file():
            matched.append(config.sfm.features)
            write_atomically(model, b"points")
        result = MagicMock(course=(), seconds={}, gaussians=(), start=MagicMock(points=()))
        result.scores.mean.to_json.return_value = {}
        return result

    monkeypatch.setattr("digs_warp.pipeline.reconstruct.reconstruct", reconstruct)
    monkeypatch.setattr(chain, "_recorded", MagicMock(return_value=MagicMock(folder=tmp_path)))
    monkeypatch.setattr(chain, "_against_truth", lambda *_: {})
    for number, changes in enumerate(({}, {"sfm.refine_poses": "off"}, {"sfm.features": 500})):
        settings = {"sfm.poses": "sfm"} | changes
        chain.run_case(Case({"n": number}, {"frames": 5}, settings), tmp_path)
    assert matched == [2000, 500]


@pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.name)
def test_a_report_is_drawn_from_some_or_all_records_old_or_new(
    study: Study, tmp_path: Path
) -> None:
    """Older records were not measured at twice the size: blanks."""
    old = [record_of(case, number) for number, case in enumerate(study.cases(1, 1, 1000))]
    new = [r | {"yardstick": r["yardstick"] | {f"{IN_PLACE}_double": 23.25}} for r in old]
    for records, shown in ((old[:1], ""), (old, ""), (new, "23.25")):
        sections = study.module.sections(records)
        page = write_pages(study.title, "", sections, tmp_path / f"{len(records)}{shown}")
        assert page.stat().st_size > 3000
        tables = [table for section in sections for table in section.tables]
        assert all(len(row) == len(t.headings) for t in tables for row in t.rows)
        column = "at twice the size [dB]"
        cells = {
            row[t.headings.index(column)] for t in tables if column in t.headings for row in t.rows
        }
        assert {cell.split(" ±")[0] for cell in cells} == {shown}


def test_what_is_shown_of_the_paper_and_which_effects_do_harm() -> None:
    records = [
        record_of(c, n) for n, c in enumerate(find_study("initialization").cases(1, 1, 1000))
    ]
    quality = find_study("initialization").module.sections(records)[0].tables[0]
    assert quality.headings[1:] == ["100", "300", "500", "1000"]
    assert quality.rows[1] == ["highdepth, paper", "23.63", "", "24.92", "25.23"]
    study, records = find_study("robustness"), []
    for case in study.cases(1, 1, 300):
        effect, strength = case.labels["effect"], case.labels["strength"]
        harm = {"shot-noise": 2.0, "vignetting": 1.0}.get(effect, 0.0) * (strength - 1)
        score = {"yardstick": {IN_PLACE: 30.0 - harm}}
        records.append(record_of(case, 0) | score)
    chart = study.module.sections(records)[1].charts[0]
    assert [curve.label for curve in chart.curves][:2] == ["shot-noise", "vignetting"]
    assert (chart.curves[0].x, chart.curves[0].y) == ([0, 1, 2, 4], [30.0, 30.0, 28.0, 24.0])


def test_what_a_knob_turns() -> None:
    cases = {
        (c.labels["knob"], c.labels["value"]): c for c in find_study("tradeoff").cases(1, 1, 300)
    }
    usual, wide = cases["usual", ""], cases["image width", 960]
    assert (wide.recording["width"], wide.recording["height"]) == (960, 540)
    assert wide.reconstruction == usual.reconstruction
    assert cases["voxel size [mm]", 16].reconstruction["init.voxel_size"] == 0.016
    assert cases["initialization", "depth"].reconstruction["init.voxel_size"] == 0.01
    assert cases["iterations", 100].reconstruction["train.stop.iterations"] == 100


def test_a_record_that_reports_cannot_use_is_named(tmp_path: Path) -> None:
    record = record_of(find_study("robustness").cases(1, 1, 300)[0], 0)
    for name, value in (("seconds", {"train": "long"}), ("machine", None), ("course", [3])):
        (tmp_path / RESULTS).write_text(json.dumps(record | {name: value}) + "\n")
        with pytest.raises(DigsError, match=rf"case {record['key']}.*; delete its line"):
            Store(tmp_path).finished()


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
    sections = {
        section.title: section for section in find_study("tradeoff").module.sections(records)
    }
    usual, row = sections["Each setting alone"].tables[0].rows
    assert usual[:4] == ["iterations", "500 (usual)", "20.0 ± 0.0", "25.00 ± 0.00"]
    assert row == ["iterations", "100", "10.0", "26.50", "", "-10.0", "+1.50"]


def test_meshes_of_ones_own_are_the_objects(tmp_path: Path) -> None:
    mug = tmp_path / "mug.glb"
    cases = find_study("robustness").cases(3, 1, 300, [mug])
    assert {case.labels["object"] for case in cases} == {"mug"}
    assert {case.recording["mesh"] for case in cases} == {mug}
    with pytest.raises(DigsError, match="two files with the same name"):
        find_study("robustness").cases(3, 1, 300, [mug, tmp_path / "other/mug.obj"])


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


def test_studies_are_listed_and_unknown_ones_and_numbers_refused(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["study", "list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == [study.name for study in STUDIES]
    flags = ("--workers", "0"), ("--time-budget", "0s"), ("--time-budget", "soon")
    of_run = (["run", "tradeoff", *flag] for flag in flags)
    for arguments in (["draw"], ["run", "nothing"], ["report", "nothing"], *of_run):
        assert main(["study", *arguments]) == 2, arguments


def sections() -> list[Section]:
    table = Table("psnr", ["strategy", "PSNR [dB]"], [["a|b", "30.1"], ["<fusion>", "31.2"]])
    curves = [
        Curve("first", [1, 10, 100], [20, 25, 30], spread=[1, 1, 2]),
        Curve("second", [1, 10], [22, 21], line=False, notes=["law", "guided"]),
    ]
    chart = Chart("course", "Quality along time", curves, "seconds", "PSNR [dB]", log_x=True)
    return [Section("Quality", "More is better & slower.", [table], [chart])]


def test_all_files_are_written(tmp_path: Path) -> None:
    page = write_pages("A <study>", "What it asks.", sections(), tmp_path)
    rows = list(csv.reader((tmp_path / "tables" / "psnr.csv").read_text().splitlines()))
    assert rows == [["strategy", "PSNR [dB]"], ["a|b", "30.1"], ["<fusion>", "31.2"]]
    markdown = (tmp_path / "report.md").read_text()
    assert "| a\\|b | 30.1 |" in markdown
    assert "](plots/course.png)" in markdown
    html = page.read_text()
    assert "&lt;fusion&gt;" in html and "<fusion>" not in html and "<study>" not in html
    assert not re.search(r'(src|href)="(?!data:)', html)
    assert read_image(tmp_path / "plots" / "course.png").shape[1] == 864


def test_the_same_numbers_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one", "two"):
        write_pages("A study", "What it asks.", sections(), tmp_path / name)
    for path in (tmp_path / "one").rglob("*.*"):
        twin = tmp_path / "two" / path.relative_to(tmp_path / "one")
        assert path.read_bytes() == twin.read_bytes(), path.name


def test_a_band_is_as_wide_above_a_curve_as_below() -> None:
    curve = Curve("flat", [0.0, 1.0], [5.0, 5.0], spread=[1.0, 1.0])
    data = io.BytesIO(Chart("band", "", [curve], "x", "y").png())
    picture = np.asarray(Image.open(data).convert("RGB"))
    column = picture[:, 3 * picture.shape[1] // 5].astype(int)
    blue = np.flatnonzero(column[:, 2] > column[:, 0] + 20)  # the band; the line is far bluer
    line = np.flatnonzero(column[:, 2] > column[:, 0] + 100)
    above, below = line.mean() - blue.min(), blue.max() - line.mean()
    assert above > 50 and abs(above - below) < 3
