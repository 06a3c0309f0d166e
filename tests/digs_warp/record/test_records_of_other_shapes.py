"""Records, courses and scores whose JSON is valid but of another shape: an error that names file and key."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.start import Start
from digs_warp.measure.scores import Scores
from digs_warp.pipeline.records import Poses, stored, stored_capture
from digs_warp.record.run_log import RunRecord
from digs_warp.study.engine.store import Store
from digs_warp.train.training import Training, read_course

NO_POINTS = PointCloud(np.zeros((0, 3)), np.zeros((0, 3)))
ROW = {"iteration": 1, "seconds": 0.5, "loss": None, "splats": 3}
RECORD: dict[str, Any] = {"command": "run", "versions": {}, "settings": {}}
CASE = {
    **{"key": "a", "machine": "x", "labels": {"knob": "usual"}},
    **{name: {} for name in ("recording", "reconstruction", "seconds", "recording_seconds")},
}


@pytest.mark.parametrize(
    "line",
    [
        "[]",
        "null",
        "[" * 100_000,
        json.dumps(ROW | {"iteration": "x"}),
        json.dumps(ROW | {"seconds": -1}),
        json.dumps(ROW | {"psnr_frame": []}),
        json.dumps(ROW | {"splats": 0.5}),
        json.dumps(ROW).replace("0.5", "1e999"),
    ],
    ids=range(8),
)
def test_a_broken_row_of_a_course_is_named(tmp_path: Path, line: str) -> None:
    path = tmp_path / "training.jsonl"
    path.write_text(f"{json.dumps(ROW)}\n{line}\n")
    with pytest.raises(DigsError, match=r"training\.jsonl', line 2"):
        read_course(path)


@pytest.mark.parametrize(
    "change",
    [
        {"command": 3},
        {"versions": []},
        {"seconds": {"train": "long"}},
        {"seconds": {"train": []}},
        {"results": 7},
    ],
    ids=str,
)
def test_a_run_record_of_another_shape_is_named(tmp_path: Path, change: dict[str, Any]) -> None:
    path = tmp_path / "run.json"
    path.write_text(json.dumps(RECORD | change))
    with pytest.raises(DigsError, match=r"run\.json'.*run again"):
        RunRecord.load(path)


@pytest.mark.parametrize(
    "results",
    [
        {"start": []},
        {"start": {"sources": {"depth": "many"}}},
        {"capture": 7},
        {"training": {"iterations": "x"}},
        {"scores": {"mean": [1]}},
        {"poses": {"scale": {"sfm_per_metre": "x"}}},
        {"poses": {"findings": [1]}},
        {"poses": {"subject": "car"}},
    ],
    ids=str,
)
def test_results_of_another_shape_are_named(results: dict[str, Any]) -> None:
    record = RunRecord("run", {}, {}, results=results)
    with pytest.raises(DigsError, match=r"run\.json', results.*; reconstruct again"):
        stored_capture(record, Path())
        for kind, known in (
            (Poses, {}),
            (Start, {"points": NO_POINTS}),
            (Training, {}),
            (Scores, {}),
        ):
            stored(kind, record, Path(), **known)


@pytest.mark.parametrize(
    "content",
    [[], {}, {"mean": {}, "views": [1]}, {"mean": {"psnr_object": "x"}, "views": []}, {"mean": 1}],
    ids=str,
)
def test_scores_of_another_shape_are_refused(content: Any) -> None:
    with pytest.raises(DigsError):
        Scores.from_json(content)


@pytest.mark.parametrize(
    "change",
    [
        {"key": 7},
        {"labels": {"knob": []}},
        {"seconds": {"train": "long"}},
        {"yardstick": {"psnr_frame": []}},
        {"course": 3},
        {"machine": {}},
    ],
    ids=str,
)
def test_a_case_of_another_shape_is_named(tmp_path: Path, change: dict[str, Any]) -> None:
    (tmp_path / "results.jsonl").write_text(json.dumps(CASE | change) + "\n")
    with pytest.raises(DigsError, match=r"results\.jsonl', line 1"):
        Store(tmp_path)


def test_a_case_that_lacks_a_part_is_named(tmp_path: Path) -> None:
    lacking = {name: value for name, value in CASE.items() if name != "machine"}
    (tmp_path / "results.jsonl").write_text(json.dumps(lacking) + "\n")
    with pytest.raises(DigsError, match="case a: has no 'machine'"):
        Store(tmp_path).finished()
