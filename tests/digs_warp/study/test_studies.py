"""The studies: cases that differ, reports from records, and one study end to end."""

import json
import shlex
from pathlib import Path
from typing import Any

import pytest

from digs_warp import cli
from digs_warp.cli import main
from digs_warp.reconstruct import ReconstructConfig
from digs_warp.study.catalogue import STUDIES, Study
from digs_warp.study.engine.case import Case, plain
from digs_warp.study.engine.overrides import with_settings
from digs_warp.study.engine.page import write_pages
from digs_warp.study.engine.store import RESULTS, Store
from sim.config import SimulateConfig

BY_NAME = {study.name: study for study in STUDIES}


def record_of(case: Case, number: int) -> dict[str, Any]:
    """What a run of ``case`` could have measured."""
    psnr = 25.0 + number % 7
    return {
        "key": case.key,
        "labels": dict(case.labels),
        "recording": plain(case.recording),
        "reconstruction": plain(case.reconstruction),
        "threads": case.threads or 2,
        "memory_mb": 900.0,
        "metrics": {"psnr": psnr, "ssim": 0.9},
        "course": [
            {"iteration": i, "seconds": i / 50, "psnr": psnr - 500 / i, "ssim": 0.9}
            for i in (100, 300, 500, 1000)
        ],
        "yardstick": {"psnr": psnr - 1, "psnr_masked": psnr - 6},
        "surface": {
            name: {"chamfer": 0.004, "accuracy_median": 0.001, "recall": 0.8, "f_score": 0.7}
            | {"spacing_ratio": 1.4}
            for name in ("points", "gaussians")
        },
        "seconds": {"initialize": 1.0, "train": 10.0 + number, "compile kernels": 99.0},
        "machine": "2 cores of a test",
        "scale_error": 0.0004,
        "finishes": {
            "alpha_cuts": [{"value": 0.0039, "seconds": 0.01, "psnr": 30.0}],
            "precisions": [{"value": "half", "megabytes": 1.5, "psnr": 29.9}],
        },
        "recording_seconds": {"render": 20.0, "sense": 500.0},
        "results": {"initial_points": 1000 + number, "gaussians": 900},
    }


@pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.name)
def test_cases_differ_and_their_settings_are_accepted(study: Study) -> None:
    cases = study.cases(2, 2, 300)
    assert len({case.key for case in cases}) == len(cases) > 10
    for case in cases:
        with_settings(SimulateConfig(), case.recording)
        config = with_settings(ReconstructConfig(), case.reconstruction)
        if case.labels.get("knob") != "iterations" and case.effort == 1:
            assert config.train.iterations == 300


@pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.name)
def test_a_report_is_drawn_from_some_or_all_records(study: Study, tmp_path: Path) -> None:
    records = [record_of(case, n) for n, case in enumerate(study.cases(2, 2, 1000))]
    for count in (1, len(records) // 2, len(records)):
        sections = study.sections(records[:count])
        page = write_pages(study.title, study.summary, sections, tmp_path / str(count))
        assert page.stat().st_size > 5000
    assert any(table.rows for section in sections for table in section.tables)


def test_the_table_of_initializations_holds_means_over_objects_and_the_papers_figures() -> None:
    study = BY_NAME["initialization"]
    records = [record_of(case, n) for n, case in enumerate(study.cases(2, 1, 1000))]
    sections = {section.title: section for section in study.sections(records)}
    psnr, _ = sections["Quality along the iterations"].tables
    assert psnr.headings == ["PSNR after", "100", "300", "500", "1000"]
    rows = {row[0]: row for row in psnr.rows}
    short = [r for r in records if r["labels"]["iterations"] == 1000]
    mine = [r["metrics"]["psnr"] for r in short if r["labels"]["strategy"] == "fusion"]
    assert rows["fusion"][4].startswith(f"{sum(mine) / len(mine) - 0.5:.2f} ±")
    assert rows["fusion, paper"][1:] == ["22.89", "", "24.71", "25.13"]


def test_the_lead_of_highdepth_is_that_of_the_same_object() -> None:
    study = BY_NAME["initialization"]
    records = [record_of(case, 0) for case in study.cases(1, 1, 1000)]
    ahead = next(r for r in records if r["labels"]["strategy"] == "highdepth")
    ahead["course"][0]["psnr"] += 7.25
    lead = study.sections(records)[0].tables[0]
    assert lead.rows[0][3:] == ["+7.25", "+0.00", "+0.00", "+0.00"]
    assert lead.rows[1][3:] == ["+6.64", "", "+2.12", "+0.89"]


def test_a_component_is_compared_with_the_recipe_on_the_same_object() -> None:
    """The second object is easier, and has one variant less: that must not count for the variant."""
    study = BY_NAME["ablation"]
    records = []
    for case in study.cases(2, 1, 1000):
        labels = case.labels
        record = record_of(case, 0)
        first = labels["object"] == study.cases(1, 1, 1000)[0].labels["object"]
        if not first and labels["variant"] == "no edge filter":
            continue
        loss = {"no edge filter": 3.0, "no k-means": 1.0}.get(labels["variant"], 0.0)
        record["course"][0]["psnr"] += (0.0 if first else 10.0) - loss
        record["yardstick"]["psnr"] += 0.25 * (labels["variant"] == "+ visibility check")
        records.append(record)
    spoilt, true, weights = study.sections(records)
    rows = {(row[0], row[1]): row for row in spoilt.tables[0].rows}
    column = list(spoilt.tables[0].headings).index("PSNR after 100 [dB]")
    name = study.cases(1, 1, 1000)[0].labels["object"]
    assert rows[name, "paper's Highdepth"][column] == "20.00"
    assert rows[name, "no edge filter"][column] == "17.00 (-3.00)"
    assert (
        "Lost most after 100 steps: no edge filter (-3.00 dB), no k-means (-1.00 dB)." in true.text
    )
    assert "Gained most at the end: + visibility check (+0.25 dB)." in spoilt.text
    assert {row[2] for row in weights.tables[0].rows} == {"1 : 3", "1 : 1", "no k-means"}


def test_a_knob_is_priced_against_the_usual_settings() -> None:
    study = BY_NAME["tradeoff"]
    cases = study.cases(1, 1, 500)
    records = [record_of(case, 0) for case in cases]
    slow = next(r for r in records if r["labels"]["knob"] == "iterations")
    slow["seconds"]["train"] += 5.0
    slow["yardstick"]["psnr"] += 1.5
    sections = {section.title: section for section in study.sections(records)}
    row = sections["Iterations"].tables[0].rows[0]
    assert row[3:] == ["+5.0", "+1.50"]
    assert "+1.50 dB for +5.0 s" in sections["Iterations"].text
    # Sensing overlaps with rendering, and compiling is no part of a run.
    assert row[1] == "36.0"


def test_a_knob_is_compared_on_the_objects_that_both_settings_have() -> None:
    """The second object is easier and slower; a budget has cut off its knobs."""
    from digs_warp.study.studies.tradeoff import best_within

    study = BY_NAME["tradeoff"]
    records = []
    for case in study.cases(2, 1, 500):
        record = record_of(case, 0) | {"recording": {}, "reconstruction": {}}
        first = case.labels["object"] == study.cases(1, 1, 500)[0].labels["object"]
        if not first and case.labels["knob"] != "usual":
            continue
        record["yardstick"]["psnr"] += 0.0 if first else 10.0
        record["seconds"]["train"] += 0.0 if first else 30.0
        records.append(record)
    sections = {section.title: section for section in study.sections(records)}
    assert sections["Iterations"].tables[0].rows[0][3:] == ["+0.0", "+0.00"]
    best = best_within(records, 1000.0)
    assert best is not None and best.quality.mean == pytest.approx(29.0)


def test_laws_find_the_costs_that_made_the_seconds() -> None:
    from digs_warp.study.studies.scaling import LAWS, PLANS, fit, load_of, value_of

    records = [record_of(case, 0) for case in BY_NAME["scaling"].cases(1, 1, 200)]
    for number, record in enumerate(records):
        record["results"]["gaussians"] = 20_000 + 7_000 * (number % 5)
        counts = load_of(record).counts()
        record["seconds"]["train"] = 1e-8 * counts["step pixels"] + 3e-7 * counts["step splats"]
        record["memory_mb"] = 400.0 + 5e-6 * counts["frame pixels"]
    train = fit(records, "train", LAWS["train"])
    assert train.coefficients == pytest.approx(
        {"steps": 0.0, "step pixels": 1e-8, "step splats": 3e-7}, rel=1e-6, abs=1e-9
    )
    largest = PLANS[-1]
    expected = 12_000 * (1e-8 * 2208 * 1242 + 3e-7 * 1e6)
    assert train.at(largest) == pytest.approx(expected, rel=1e-6)
    memory = fit(records, "memory", LAWS["memory"])
    assert memory.at(load_of(records[0])) == pytest.approx(value_of(records[0], "memory"), rel=1e-6)


def test_every_effect_is_measured_and_the_worst_comes_first() -> None:
    from sim.sensor_plan import ALL_EFFECT_NAMES

    study = BY_NAME["robustness"]
    cases = study.cases(1, 1, 300)
    assert {case.labels["effect"] for case in cases} == {*ALL_EFFECT_NAMES, "none", "all together"}
    records = [record_of(case, 0) for case in cases]
    mild, harmful, idle = ALL_EFFECT_NAMES[0], ALL_EFFECT_NAMES[3], ALL_EFFECT_NAMES[5]
    for record in records:
        loss = {mild: 0.001, harmful: 4.0}.get(record["labels"]["effect"], 0.0)
        record["yardstick"]["psnr"] -= loss
    sections = {section.title: section for section in study.sections(records)}
    alone = sections["Each effect alone"]
    assert alone.tables[0].rows[0][0] == harmful
    stages = {row[0]: row for row in sections["Which stage is hurt"].tables[0].rows}
    assert stages[harmful][-1] == "-4.00" and stages[mild][-1] == "-0.00"
    assert idle not in stages and idle in alone.text.split("changed nothing: ")[1]


def test_settings_are_recommended_within_a_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cases = BY_NAME["tradeoff"].cases(1, 1, 500)
    store = Store(tmp_path)
    for case in cases:
        record = record_of(case, 0)
        if case.labels["value"] == 2000:
            record["seconds"]["train"] = 60.0
            record["yardstick"]["psnr"] = 35.0
        if case.labels["value"] == 24:
            record["yardstick"]["psnr"] = 30.0
        if case.labels["value"] == "truth":  # no answer to how good a recording comes out
            record["yardstick"]["psnr"] = 45.0
        store.add(record)
    folder = ["--study", str(tmp_path)]
    assert main(["recommend", "--budget", "50s", *folder]) == 0
    quick = capsys.readouterr().out
    assert "frames 24" in quick and "--iterations 500" in quick
    assert main(["recommend", "--budget", "5m", *folder]) == 0
    slow = capsys.readouterr().out
    assert "--iterations 2000" in slow and "35.00 dB" in slow
    command = next(line for line in slow.splitlines() if line.startswith("command"))
    cli.parse(shlex.split(command)[2:])
    assert main(["recommend", "--budget", "1s", *folder]) != 0
    assert "nothing that" in capsys.readouterr().err


def test_without_a_study_of_ones_own_the_published_one_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("digs_warp.commands.recommend.PUBLISHED", tmp_path / "published")
    assert main(["recommend", "--budget", "50s"]) == 1
    assert "digs-warp study run tradeoff --out out/study/tradeoff" in capsys.readouterr().err
    for folder, psnr in (("published", 20.0), ("out/study/tradeoff", 40.0)):
        case = BY_NAME["tradeoff"].cases(1, 1, 500)[0]
        record = record_of(case, 0) | {"recording": {"frames": 40}, "reconstruction": {}}
        record["yardstick"]["psnr"] = psnr
        Store(tmp_path / folder).add(record)
        assert main(["recommend", "--budget", "50s"]) == 0
        assert f"{psnr:.2f} dB" in capsys.readouterr().out


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
                | {"init.voxel_size": 0.02, "train.iterations": iterations, "test_every": 3},
            )
            for error in (0.0, 2.0)
        ]

    monkeypatch.setattr(segmentation, "cases", few)
    out = tmp_path / "out"
    assert main(["study", "run", "segmentation", "--out", str(out), "--iterations", "4"]) == 0
    assert "2 cases measured" in capsys.readouterr().out
    records = [json.loads(line) for line in (out / RESULTS).read_text().splitlines()]
    for record in records:
        assert record["yardstick"]["psnr"] > 5
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
    arguments = ["study", "run", "segmentation", "--budget", "0.0000001s"]
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
        *(["run", "tradeoff", "--budget", "0s"], ["run", "tradeoff", "--budget", "soon"], ["draw"]),
    ],
)
def test_unknown_studies_and_numbers_are_refused(arguments: list[str]) -> None:
    assert main(["study", *arguments]) == 2


def test_a_report_of_nothing_says_what_to_measure(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "report", "tradeoff", "--out", "/nonexistent"]) == 1
    assert "digs-warp study run tradeoff" in capsys.readouterr().err
