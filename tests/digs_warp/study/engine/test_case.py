"""Cases and their settings; groups of records, spreads and the Pareto front."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from digs_warp.checks import DigsError
from digs_warp.engines.task import RESULTS
from digs_warp.study.engine.case import Case, with_settings
from digs_warp.study.engine.records import (
    Column,
    Spread,
    at_iteration,
    curve,
    group_by,
    number,
    pareto_front,
    spread,
    tabulate,
)

DOCS = Path(__file__).parents[4] / "docs"


@dataclass(frozen=True)
class Inner:
    low: int = 1
    high: int = 2

    def __post_init__(self) -> None:
        if self.low > self.high:
            raise DigsError("low above high")


@dataclass(frozen=True)
class Outer:
    inner: Inner = field(default_factory=Inner)
    name: str = "x"


def test_settings_change_by_dotted_names_and_are_checked_together() -> None:
    changed = with_settings(Outer(), {"inner.high": 7, "name": "y"})
    assert changed == Outer(Inner(1, 7), "y")
    # One after the other, low = 5 would be refused.
    assert with_settings(Outer(), {"inner.low": 5, "inner.high": 9}).inner == Inner(5, 9)
    with pytest.raises(DigsError, match="low above high"):
        with_settings(Outer(), {"inner.low": 5})
    for name in ("nothing", "inner.nothing", "nothing.low"):
        with pytest.raises(DigsError, match="unknown setting 'nothing'"):
            with_settings(Outer(), {name: 1})


def test_the_key_follows_the_content_and_neither_the_order_nor_where_files_lie() -> None:
    first = Case({"a": 1, "b": 2}, {"frames": 3})
    assert first.key == Case({"b": 2, "a": 1}, {"frames": 3}).key
    assert first.key != Case({"a": 1, "b": 2}, {"frames": 4}).key
    assert first.recording_key == Case({}, {"frames": 3}, {"test_every": 4}).recording_key
    here, there = (Case({}, {"mesh": f"{folder}/mug.glb", "environment": None}) for folder in "ab")
    assert here.key == there.key != Case({}, {"mesh": "a/cup.glb", "environment": None}).key
    assert here.recording_key != there.recording_key  # recordings are made from the files


def test_a_published_study_can_be_continued() -> None:
    for line in (DOCS / "study/tradeoff" / RESULTS).read_text(encoding="utf-8").splitlines():
        record = json.loads(line)
        settings = (record[name] for name in ("labels", "recording", "reconstruction"))
        assert Case(*settings).key == record["key"]


def record(psnr: float, **labels: Any) -> dict[str, Any]:
    course = [{"iteration": 100, "seconds": 2.0, "psnr": psnr - 5}]
    course += [{"iteration": 300, "seconds": 6.0, "psnr": psnr}]
    return {"labels": labels, "metrics": {"psnr": psnr}, "course": course}


RECORDS = [
    record(30.0, strategy="depth", seed=0),
    record(32.0, strategy="depth", seed=1),
    record(20.0, strategy="random", seed=0),
]


def test_mean_and_deviation() -> None:
    groups = group_by(RECORDS, "strategy")
    assert list(groups) == [("depth",), ("random",)]
    found = spread(groups["depth",], lambda r: r["metrics"]["psnr"])
    assert found is not None
    assert (found.mean, found.count) == (31.0, 2)
    assert found.deviation == pytest.approx(2**0.5)
    assert found.text(1) == "31.0 ± 1.4"
    assert spread(RECORDS, lambda r: None) is None
    one = Spread.of([5.0])
    assert one is not None and one.text(2) == "5.00"


def test_what_was_not_measured_is_none() -> None:
    assert at_iteration(100, "psnr")(RECORDS[0]) == 25.0
    assert at_iteration(200, "psnr")(RECORDS[0]) is at_iteration(500, "psnr")(RECORDS[0]) is None
    assert number("metrics", "psnr", factor=10)(RECORDS[0]) == 300.0
    assert number("metrics", "ssim")(RECORDS[0]) is None
    assert number("surface", "points", "chamfer")({"surface": {}}) is None


def test_a_table_has_a_row_per_group_and_blanks_where_nothing_was_measured() -> None:
    columns = [Column(name, 1, number("metrics", name)) for name in ("psnr", "ssim")]
    table = tabulate("end", ("strategy", "seed"), group_by(RECORDS, "strategy", "seed"), columns)
    assert table.headings == ["strategy", "seed", "psnr", "ssim"]
    assert table.rows[1] == ["depth", "1", "32.0", ""]


def test_a_curve_leaves_out_points_that_were_not_measured() -> None:
    found = curve("depth", {0.0: RECORDS[:2], 1.0: []}, number("metrics", "psnr"))
    assert (found.x, found.y) == ([0.0], [31.0])


def test_the_front_holds_what_nothing_beats() -> None:
    points = [(5.0, 1.0), (1.0, 1.0), (2.0, 3.0), (3.0, 2.0), (4.0, 4.0), (1.0, 0.5), (4.0, 4.0)]
    assert pareto_front(points) == [1, 2, 4]
    assert pareto_front([]) == []
