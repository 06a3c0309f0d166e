"""Records, courses and scores whose JSON is valid but of another shape: an error that names file and key."""

import json
from pathlib import Path
from typing import Any

import pytest

from digs_warp.checks import DigsError
from digs_warp.record.run_log import RunRecord
from digs_warp.study.engine.store import Store
from digs_warp.train.training import read_course

ROW = {"iteration": 1, "seconds": 0.5, "loss": None, "splats": 3}
RECORD: dict[str, Any] = {"command": "run", "versions": {}, "settings": {}}
CASE = {
    **{"key": "a", "machine": "x", "labels": {"knob": "usual"}},
    **{name: {} for name in ("recording", "reconstruction", "seconds", "recording_seconds")},
}


def test_a_broken_row_of_a_course_is_named(tmp_path: Path) -> None:
    changes = {"iteration": "x"}, {"seconds": -1}, {"psnr_frame": []}, {"splats": 0.5}
    rows = [json.dumps(ROW | change) for change in changes]
    path = tmp_path / "training.jsonl"
    for line in ("[]", "null", "[" * 100_000, *rows, json.dumps(ROW).replace("0.5", "1e999")):
        path.write_text(f"{json.dumps(ROW)}\n{line}\n")
        with pytest.raises(DigsError, match=r"training\.jsonl', line 2"):
            read_course(path)


def test_a_run_record_of_another_shape_is_named(tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    seconds = ({"seconds": {"train": wrong}} for wrong in ("long", []))
    for change in ({"command": 3}, {"versions": []}, *seconds, {"results": 7}):
        path.write_text(json.dumps(RECORD | change))
        with pytest.raises(DigsError, match=r"run\.json'.*run again"):
            RunRecord.load(path)


def test_a_case_of_another_shape_or_that_lacks_a_part_is_named(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    for change in (
        *({"key": 7}, {"labels": {"knob": []}}, {"seconds": {"train": "long"}}),
        *({"yardstick": {"psnr_frame": []}}, {"course": 3}, {"machine": {}}),
    ):
        path.write_text(json.dumps(CASE | change) + "\n")
        with pytest.raises(DigsError, match=r"results\.jsonl', line 1"):
            Store(tmp_path)
    lacking = {name: value for name, value in CASE.items() if name != "machine"}
    path.write_text(json.dumps(lacking) + "\n")
    with pytest.raises(DigsError, match="case a: has no 'machine'"):
        Store(tmp_path).finished()
