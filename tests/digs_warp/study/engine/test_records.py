"""Groups, spreads and the Pareto front."""

from typing import Any

import pytest

from digs_warp.study.engine.records import (
    Spread,
    at_iteration,
    group_by,
    pareto_front,
    seconds_to_quality,
    spread,
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


def test_groups_keep_the_order() -> None:
    groups = group_by(RECORDS, "strategy")
    assert list(groups) == [("depth",), ("random",)]
    assert len(groups["depth",]) == 2


def test_mean_and_deviation() -> None:
    found = spread(RECORDS[:2], lambda r: r["metrics"]["psnr"])
    assert found is not None
    assert (found.mean, found.count) == (31.0, 2)
    assert found.deviation == pytest.approx(2**0.5)
    assert found.text(1) == "31.0 ± 1.4"
    assert spread(RECORDS, lambda r: None) is None
    one = Spread.of([5.0])
    assert one is not None and one.text(2) == "5.00"


def test_values_along_the_course() -> None:
    assert at_iteration(RECORDS[0], 100, "psnr") == 25.0
    assert at_iteration(RECORDS[0], 500, "psnr") is None
    assert seconds_to_quality(RECORDS[0], 26.0) == 6.0
    assert seconds_to_quality(RECORDS[0], 40.0) is None


def test_the_front_holds_what_nothing_beats() -> None:
    points = [(5.0, 1.0), (1.0, 1.0), (2.0, 3.0), (3.0, 2.0), (4.0, 4.0), (1.0, 0.5), (4.0, 4.0)]
    assert pareto_front(points) == [1, 2, 4]
    assert pareto_front([]) == []
