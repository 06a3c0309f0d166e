"""The study of the camera in the training: what is off where, and what its tables make of records."""

from typing import Any

from digs_warp.pipeline.reconstruct import ReconstructConfig
from digs_warp.study.engine.case import Case, with_settings
from digs_warp.study.studies import camera
from digs_warp.train.config import DEPTH_WEIGHT, TrainConfig
from reference.study_records import record_of


def config_of(training: str) -> ReconstructConfig:
    case = next(case for case in camera.cases(2) if case.labels["training"] == training)
    return with_settings(ReconstructConfig(), case.reconstruction)


def test_nothing_is_all_parts_off_and_everything_is_the_defaults() -> None:
    config = config_of(camera.NOTHING)
    train = config.train
    assert (train.fit_exposure, train.rolling_shutter, train.motion_blur) == ("off",) * 3
    assert (train.clean_rim, config.sfm.refine_poses, train.sh_degree) == ("off", "off", 1)
    assert train.depth_weight_where(recorded=True) == 0.0
    everything = config_of(camera.EVERYTHING)
    assert everything.train == TrainConfig(stop=everything.train.stop)
    assert everything.train.depth_weight_where(recorded=True) == DEPTH_WEIGHT
    assert everything.sfm.refine_poses == "auto"


def test_without_a_part_only_that_part_is_off() -> None:
    for part, row in camera.PARTS.items():
        case = next(c for c in camera.cases(2) if c.labels["training"] == camera.without(part))
        source = camera.SOURCES[case.labels["source"]]
        own = {"train.stop.iterations", "train.seed", *source.reconstruction}
        changed = {n: v for n, v in case.reconstruction.items() if n not in own}
        assert changed == dict(row.off)


def test_each_training_of_a_recording_shares_it_and_has_its_defaults_beside_it() -> None:
    cases = camera.cases(2)
    recordings: dict[tuple[str, str], set[str]] = {}
    for case in cases:
        place = case.labels["object"], case.labels["source"]
        recordings.setdefault(place, set()).add(case.recording_key)
    assert all(len(keys) == 1 for keys in recordings.values())
    for case in cases:
        beside = [c for c in cases if c.recording_key == case.recording_key]
        assert any(c.labels["training"] == camera.EVERYTHING for c in beside)


def measured(gain: float = 2.0) -> list[dict[str, Any]]:
    """Records of one object: the defaults gain, and lie nearer; without the depth term they gain .5 more."""
    first = camera.cases(1)[0].labels["object"]
    return [_record(case, gain) for case in camera.cases(1) if case.labels["object"] == first]


def _record(case: Case, gain: float) -> dict[str, Any]:
    record = record_of(case, 0)
    training = case.labels["training"]
    gains = {camera.NOTHING: 0.0, camera.without("depth term"): gain + 0.5}
    psnr = 25.0 + gains.get(training, gain)
    record["yardstick"] |= {
        "psnr_object_one_gain": psnr - 3.0,
        "psnr_object_in_place": psnr,
        "psnr_object_in_scale": psnr + 1.0,
    }
    far = training in (camera.NOTHING, camera.without("depth term"))
    record["results"]["surface"] = {"accuracy": 0.0035, "completeness": 0.004}
    record["surface"] = {"accuracy_in_place": 0.0015 if far else 0.0005}
    record["cpu_seconds"] = 20.0 if far else 22.0
    return record


def test_the_table_holds_nothing_beside_everything() -> None:
    compared, _ = camera.sections(measured())
    medians, every, places = compared.tables
    assert [row[0] for row in places.rows] == [camera.SPOILED, camera.ESTIMATED]
    assert all(
        row[1:] == ["22.00", "25.00", "26.00", "24.00", "27.00", "28.00"] for row in places.rows
    )
    assert [row[0] for row in medians.rows] == list(camera.COMPARED)
    cells = ["25.00", "27.00", "1.50", "0.50", "20.0", "22.0"]
    assert all(row[1:] == ["1", *cells] for row in medians.rows)
    assert [row[1] for row in every.rows] == list(camera.COMPARED)
    assert every.rows[0][2:] == cells
    assert list(compared.charts[0].curves[0].x) == [2.0] * len(camera.COMPARED)


def test_sources_that_were_measured_earlier_are_named() -> None:
    records = measured()
    assert "measured earlier" not in camera.sections(records)[0].text
    for record in records:
        if record["labels"]["source"] == camera.SENSOR:
            score = record["yardstick"]
            score["psnr_object_aligned"] = score.pop("psnr_object_in_place")
            del score["psnr_object_one_gain"]
    compared, _ = camera.sections(records)
    assert f"fitted to each view: {camera.SENSOR}." in compared.text
    assert all(row[2:4] == ["25.00", "27.00"] for row in compared.tables[0].rows)


def test_what_the_defaults_make_worse_is_named() -> None:
    assert f"{camera.SENSOR} (-1.00 dB)" in camera.sections(measured(gain=-1.0))[0].text
    text = camera.sections(measured())[0].text
    assert text.endswith(
        "Images that the defaults make worse: none. Surfaces that the defaults make worse: none."
    )


def test_a_part_is_worth_what_the_defaults_lose_without_it() -> None:
    _, left_out = camera.sections(measured())
    rows = {(row[0], row[1]): row[2:] for row in left_out.tables[0].rows}
    depth = ["1", "-0.50", "-0.50", "-0.50", "-1.00", "+2.0"]
    assert rows["depth term", camera.EXACT] == rows["depth term", camera.SENSOR] == depth
    assert rows["clean rim", camera.EXACT] == ["1", "+0.00", "+0.00", "+0.00", "+0.00", "+0.0"]


def test_half_a_pair_is_not_compared() -> None:
    records = [r for r in measured() if r["labels"]["training"] == camera.NOTHING]
    compared, left_out = camera.sections(records)
    assert not compared.charts
    assert not any(table.rows for table in [*compared.tables, *left_out.tables])
