"""What the studies' reports say of records whose numbers are known."""

from pathlib import Path

import pytest

from digs_warp.study.catalogue import STUDIES, Study
from digs_warp.study.page import write_pages
from reference.study_records import record_of

BY_NAME = {study.name: study for study in STUDIES}


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
    assert psnr.headings == ["PSNR of the frame after", "100", "300", "500", "1000"]
    rows = {row[0]: row for row in psnr.rows}
    short = [r for r in records if r["labels"]["iterations"] == 1000]
    mine = [r["metrics"]["psnr_object"] for r in short if r["labels"]["strategy"] == "fusion"]
    assert rows["fusion"][4].startswith(f"{sum(mine) / len(mine) - 0.5:.2f} ±")
    assert rows["fusion, paper"][1:] == ["22.89", "", "24.71", "25.13"]


def test_the_lead_of_highdepth_is_that_of_the_same_object() -> None:
    study = BY_NAME["initialization"]
    records = [record_of(case, 0) for case in study.cases(1, 1, 1000)]
    ahead = next(r for r in records if r["labels"]["strategy"] == "highdepth")
    ahead["course"][0]["psnr_frame"] += 7.25
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
        record["course"][0]["psnr_object"] += (0.0 if first else 10.0) - loss
        record["yardstick"]["psnr_object_in_place"] += 0.25 * (
            labels["variant"] == "+ visibility check"
        )
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
    slow["yardstick"]["psnr_object_in_place"] += 1.5
    sections = {section.title: section for section in study.sections(records)}
    row = sections["Iterations"].tables[0].rows[0]
    assert row[3:] == ["+5.0", "+1.50"]
    assert "Best: 100, +1.50 dB for +5.0 s" in sections["Iterations"].text
    assert "None is better; nearest: 16, +0.00 dB for +0.0 s" in sections["Frames"].text
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
        record["yardstick"]["psnr_object_in_place"] += 0.0 if first else 10.0
        record["seconds"]["train"] += 0.0 if first else 30.0
        records.append(record)
    sections = {section.title: section for section in study.sections(records)}
    assert sections["Iterations"].tables[0].rows[0][3:] == ["+0.0", "+0.00"]
    best = best_within(records, 1000.0)
    assert best is not None and best.quality.mean == pytest.approx(29.0)


def test_a_busier_machine_for_one_object_does_not_change_what_a_setting_costs() -> None:
    study = BY_NAME["tradeoff"]
    records = []
    for case in study.cases(2, 1, 500):
        record = record_of(case, 0)
        longer = 5.0 * (case.labels["knob"] == "iterations")
        slowness = (
            1.0 if case.labels["object"] == study.cases(1, 1, 500)[0].labels["object"] else 3.0
        )
        record["seconds"]["train"] = slowness * (record["seconds"]["train"] + longer)
        for stages in (record["seconds"], record["recording_seconds"]):
            stages |= {name: slowness * value for name, value in stages.items() if name != "train"}
        records.append(record)
    sections = {section.title: section for section in study.sections(records)}
    # 31 s and 93 s with the usual settings, 36 s and 108 s with more iterations.
    assert sections["Iterations"].tables[0].rows[0][1:4:2] == ["72.0 ± 0.0", "+10.0"]


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
    from digs_warp.sim.record.sensor_plan import ALL_EFFECT_NAMES

    study = BY_NAME["robustness"]
    cases = study.cases(1, 1, 300)
    assert {case.labels["effect"] for case in cases} == {*ALL_EFFECT_NAMES, "none", "all together"}
    records = [record_of(case, 0) for case in cases]
    mild, harmful, idle = ALL_EFFECT_NAMES[0], ALL_EFFECT_NAMES[3], ALL_EFFECT_NAMES[5]
    for record in records:
        loss = {mild: 0.001, harmful: 4.0}.get(record["labels"]["effect"], 0.0)
        record["yardstick"]["psnr_object_in_place"] = record["yardstick"]["psnr_object"] - loss
    sections = {section.title: section for section in study.sections(records)}
    alone = sections["Each effect alone"]
    assert alone.tables[0].rows[0][0] == harmful
    stages = {row[0]: row for row in sections["Which stage is hurt"].tables[0].rows}
    assert stages[harmful][-1] == "-4.00" and stages[mild][-1] == "-0.00"
    assert idle not in stages and idle in alone.text.split("changed nothing: ")[1]
