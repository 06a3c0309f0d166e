"""The study of few views: as many training views as its labels say, and what its report makes of records."""

from pathlib import Path

import pytest

from digs_warp.data.capture import Capture
from digs_warp.formats.captures.formats import export_capture
from digs_warp.pipeline.reconstruct import ReconstructConfig
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.study.engine.case import with_settings
from digs_warp.study.engine.chain import run_case
from digs_warp.study.real_recordings import RealRecording, few_frames
from digs_warp.study.studies import few_real_views, few_views
from digs_warp.train.config import DEPTH_WEIGHT
from reference.study_records import record_of


@pytest.fixture(autouse=True)
def without_real_recordings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(few_real_views, "is_there", lambda name: False)


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
        is_dense = config.init.strategy == "highdepth"
        assert is_dense == case.labels["strategy"].startswith("highdepth")
        is_open = case.labels["strategy"] == few_views.OPEN
        assert config.init.fill_unseen == ("off" if is_open else "auto")
        assert config.train.density.strategy == ("fixed" if is_dense else "adaptive")
        assert config.needs_sfm == (case.labels["strategy"] == "default")


def test_all_strategies_share_a_recording() -> None:
    cases = few_views.cases(2, 1, 1000)
    assert len(cases) == 2 * (4 * 3 * 2 + 2)  # with three and six views, one that stays open
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
            record["yardstick"]["psnr_object_in_place"] += 10
        record["yardstick"]["psnr_object_in_place"] += 1.25 * (labels["depth loss"] == "on")
        records.append(record)
    quality, loss, *_ = few_views.sections(records)
    assert quality.tables[0].headings[-1] == "objects"
    assert [(row[2], row[-1]) for row in quality.tables[0].rows] == [("on", "2"), ("off", "1")]
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


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sample data with a tiny recording in another program's format."""
    data = tmp_path_factory.mktemp("data")
    small = SimulateConfig(frames=12, width=64, samples_per_pixel=1, tier="law")
    export_capture(simulate(small, data / "capture"), "tum", data / "rgbd/orbit")
    return data


@pytest.fixture
def orbit(data: Path, monkeypatch: pytest.MonkeyPatch) -> RealRecording:
    """The recording as the only real one."""
    known = RealRecording("orbit", "tum")
    monkeypatch.setattr("digs_warp.study.real_recordings.RECORDINGS", (known,))
    monkeypatch.setattr(few_real_views, "RECORDINGS", ("orbit",))
    monkeypatch.setattr(few_real_views, "is_there", lambda name: name == "orbit")
    monkeypatch.setenv("DIGS_WARP_SAMPLE_DATA", str(data))
    return known


def test_real_recordings_come_after_the_first_object(orbit: RealRecording) -> None:
    cases = few_views.cases(1, 1, 1000)
    simulated = 4 * 3 * 2 + 2
    assert all(case.real is None for case in cases[:simulated])
    real = cases[simulated:]
    assert [case.real for case in real] == ["orbit"] * 3 * 4
    assert {case.recording["frames"] for case in real} == {6, 12, 24}
    assert [c.labels["strategy"] for c in real if c.labels["depth loss"] == "off"] == [
        "highdepth"
    ] * 3
    records = [record_of(case, n) for n, case in enumerate(cases)]
    *_, section = few_views.sections(records)
    assert section.title == "Real recordings" and len(section.tables[0].rows) == len(real)
    quality = few_views.sections(records)[0].tables[0]
    assert len(quality.rows) == simulated, "objects are not mixed with rooms"


def test_a_real_recording_is_measured_on_its_held_out_frames(
    orbit: RealRecording, tmp_path: Path
) -> None:
    (case,) = [
        case
        for case in few_real_views.cases(["highdepth"], {"on": None}, 100, 0, 2)
        if case.labels["views"] == 3
    ]
    measured = run_case(case, tmp_path)
    assert measured["metrics"]["psnr_frame"] > 0 and measured["results"]["adherence"] > 0
    assert not measured["yardstick"] and measured["scale_error"] is None
    record = record_of(case, 0) | measured
    (row,) = few_views.sections([record])[0].tables[0].rows
    assert row[:4] == ["orbit", "3", "highdepth", "on"] and all(row[4:])


def test_frames_of_a_real_recording_are_converted_once(
    orbit: RealRecording, tmp_path: Path
) -> None:
    capture = few_frames("orbit", 6, tmp_path / "few")
    assert len(capture) == 6 and capture.has_depth and capture.knows_poses
    assert [path.name for path in tmp_path.iterdir()] == ["few"], "nothing else stays"
    before = (tmp_path / "few/transforms.json").stat().st_mtime_ns
    assert len(few_frames("orbit", 6, tmp_path / "few")) == 6
    assert (tmp_path / "few/transforms.json").stat().st_mtime_ns == before
    (tmp_path / "few/transforms.json").unlink()  # as an interrupted conversion leaves it
    (tmp_path / "few/left").touch()
    assert len(few_frames("orbit", 6, tmp_path / "few")) == 6
    assert not (tmp_path / "few/left").exists()
