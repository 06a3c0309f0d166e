"""Groups, spreads and the Pareto front."""

from typing import Any

import pytest

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
