"""The study of few views: as many training views as its labels say, and what its report makes of records."""

import pytest

from digs_warp.data.capture import Capture
from digs_warp.pipeline.reconstruct import ReconstructConfig
from digs_warp.sim.config import SimulateConfig
from digs_warp.study.engine.case import with_settings
from digs_warp.study.studies import few_views
from digs_warp.train.config import DEPTH_WEIGHT
from reference.study_records import record_of


def test_a_case_trains_on_as_many_views_as_it_says() -> None:
    cases = few_views.cases(1, 1, 1000)
    assert {case.labels["views"] for case in cases} == {3, 6, 12, 24}
    for case in cases:
        recording = with_settings(SimulateConfig(), case.recording)
        config = with_settings(ReconstructConfig(), case.reconstruction)
        frames: list[int] = list(range(recording.frame_count))
        training, held_out = Capture(None, frames, None).split(config.test_every)  # pyright: ignore
        assert len(training) == len(held_out) == case.labels["views"]
        weight = config.train.depth_weight_where(recorded=True)
        assert weight == (DEPTH_WEIGHT if case.labels["depth loss"] == "on" else 0.0)
        is_dense = case.labels["strategy"] == "highdepth"
        assert config.train.density.strategy == ("fixed" if is_dense else "adaptive")
        assert config.needs_sfm == (case.labels["strategy"] == "default")


def test_all_strategies_share_a_recording() -> None:
    cases = few_views.cases(2, 1, 1000)
    assert len(cases) == 2 * 4 * 3 * 2
    assert len({case.recording_key for case in cases}) == 2 * 4


def test_the_gain_of_depth_is_that_of_the_same_object() -> None:
    """Only one object was measured without depth in the loss: the other, easier one must not count."""
    records = []
    for case in few_views.cases(2, 1, 1000):
        labels = case.labels
        if labels["strategy"] != "random" or labels["views"] != 6:
            continue
        record = record_of(case, 0)
        first = not records or records[0]["labels"]["object"] == labels["object"]
        if not first:
            if labels["depth loss"] == "off":
                continue
            record["yardstick"]["psnr_object"] += 10
        record["yardstick"]["psnr_object"] += 1.25 * (labels["depth loss"] == "on")
        records.append(record)
    _, loss, *_ = few_views.sections(records)
    assert loss.tables[0].rows == [["6", "random", "+1.25", "+1.25", "+1.25", "1"]]


def test_what_an_early_stop_would_keep() -> None:
    record = record_of(few_views.cases(1, 1, 1000)[0], 0)
    record["course"][1]["psnr_object"] = 33.0
    record["metrics"]["psnr_object"] = 30.5
    assert few_views.best_of_course(record) == 33.0
    assert few_views.lost_at_the_end(record) == pytest.approx(2.5)
    record["metrics"]["psnr_object"] = 34.0
    assert few_views.lost_at_the_end(record) == 0.0
    record["course"] = []
    assert few_views.lost_at_the_end(record) is None


def test_published_figures_stand_beside_three_views_only() -> None:
    records = [record_of(case, n) for n, case in enumerate(few_views.cases(1, 1, 1000))]
    published = few_views.sections(records)[-1]
    rows = {row[0]: row for row in published.tables[0].rows}
    assert rows["FSGS"][1:] == ["LLFF", "20.43"]
    three = next(r for r in records if r["labels"]["views"] == 3)
    name = "highdepth"
    assert three["labels"]["strategy"] == name and three["labels"]["depth loss"] == "on"
    assert rows[name][1:] == ["our objects", f"{three['metrics']['psnr_frame']:.2f}"]
