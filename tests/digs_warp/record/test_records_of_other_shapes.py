"""Records, courses and scores whose JSON is valid but of another shape: an error that names file and key."""

import json
from pathlib import Path
from typing import Any

import pytest

from digs_warp.checks import DigsError
from digs_warp.record.run_log import RunRecord
from digs_warp.train.training import read_course

ROW = {"iteration": 1, "seconds": 0.5, "loss": None, "splats": 3}
RECORD: dict[str, Any] = {"command": "run", "versions": {}, "settings": {}}


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
