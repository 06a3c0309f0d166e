"""The table of what changed between two results of a study."""

import json
from pathlib import Path
from typing import Any

import page_marks
import pytest
import study_change


def record(psnr: float, scale: float | None, **labels: Any) -> dict[str, Any]:
    return {"labels": labels, "metrics": {"psnr_object": psnr}, "scale_error": scale}


def written(path: Path, *records: dict[str, Any]) -> Path:
    path.write_text("\n".join(map(json.dumps, records)) + "\n")
    return path


def test_cases_of_both_files_stand_side_by_side(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page_marks, "DOCS", tmp_path)
    page = tmp_path / "studies.md"
    page.write_text("# Studies\n\n<!-- change toy: written by x -->\nold\n<!-- end -->\nrest\n")
    before = written(
        tmp_path / "before.jsonl",
        record(30.0, -0.001, object="cow", iterations=300, strength=0.5, seed=0),
        record(31.0, None, object="cow", iterations=300, strength=0.5, seed=1),
        record(99.0, 0.5, object="gone", iterations=300, strength=1.0, seed=0),
    )
    now = written(
        tmp_path / "now.jsonl",
        record(31.5, None, object="cow", iterations=300, strength=0.5, seed=1),
        record(29.25, 0.0145, object="cow", iterations=300, strength=0.5, seed=0),
        record(11.0, 0.5, object="new", iterations=300, strength=1.0, seed=0),
    )
    study_change.main(["toy", str(before), str(now)])
    lines = page.read_text().splitlines()
    assert lines[5:7] == [
        "| cow, 300 steps, strength 0.5 | 30.00 | 29.25 | 0.10 % | 1.45 % |",
        "| cow, 300 steps, strength 0.5, seed 1 | 31.00 | 31.50 |  |  |",
    ]
    assert lines[-1] == "rest" and "old" not in lines
    study_change.main(["toy", str(before), str(now), "seed 1"])
    lines = page.read_text().splitlines()
    assert lines[5] == "| cow, 300 steps, strength 0.5, seed 1 | 31.00 | 31.50 |  |  |"
    assert lines[6:] == ["<!-- end -->", "rest"]
    with pytest.raises(ValueError, match="no case"):
        study_change.change_table({}, study_change.cases_of(now))
