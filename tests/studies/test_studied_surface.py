"""The benchmark of surfaces: fused depth and every weight on one recording, with ratios and medians."""

from pathlib import Path

import pytest

from digs_warp.checks import DigsError
from digs_warp.sim.config import SimulateConfig
from digs_warp.study.scenes import BUILT_IN, SAMPLE_OBJECTS
from reference.optional import open3d_or_skip
from studies.benchmarks import find_benchmark
from studies.results import Result, tables
from studies.surface import FUSED, MILLIMETERS, RATIO, Scope, bench_surface, with_medians


def test_every_weight_stands_beside_the_fused_depth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    open3d_or_skip()
    monkeypatch.setenv("DIGS_WARP_SAMPLE_DATA", str(tmp_path))  # the built-in object alone
    small = SimulateConfig(frames=10, width=128, height=72, samples_per_pixel=1)
    scope = Scope(tiers=("truth",), weights=(0.0, 0.2), recording=small, iterations=30)
    results = bench_surface(scope=scope)
    rows = {r.labels["surface"]: r.values for r in results if r.table == "objects"}
    assert list(rows) == [FUSED, "weight 0", "weight 0.2"]
    fused = rows[FUSED][MILLIMETERS]
    assert 0 < fused < 20  # mm; a pixel is 8 mm wide
    for values in rows.values():
        assert values[RATIO] == pytest.approx(values[MILLIMETERS] / fused)
    assert rows["weight 0.2"]["adherence [mm]"] != rows["weight 0"]["adherence [mm]"]
    medians = {r.labels["surface"]: r.values for r in results if r.table == "medians"}
    assert medians == rows  # of one object
    captions = [table.caption for table in tables(results)]
    assert captions == [
        "image: 128x72, frames: 10, iterations: 30, sensor: truth" + more
        for more in (f", object: {BUILT_IN}", "")
    ]


def test_parts_together_have_the_medians_of_all_objects() -> None:
    def row(sensor: str, name: str, millimeters: float) -> Result:
        labels = {"sensor": sensor, "object": name, "surface": FUSED}
        return Result(labels, {MILLIMETERS: millimeters}, "objects")

    parts = {
        "mug": [row("law", "mug", 1.0), row("guided", "mug", 4.0)],
        "cup": [row("law", "cup", 3.0), row("guided", "cup", 8.0)],
    }
    joined = find_benchmark("surface").joined(
        [r for each in parts.values() for r in with_medians(each)]
    )
    assert [r.labels.get("object") for r in joined] == ["mug", "cup", "mug", "cup", None, None]
    assert [r.values[MILLIMETERS] for r in joined] == [1.0, 3.0, 4.0, 8.0, 2.0, 6.0]


def test_some_objects_can_be_measured_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert find_benchmark("surface").cases == SAMPLE_OBJECTS
    monkeypatch.setenv("DIGS_WARP_SAMPLE_DATA", str(tmp_path))
    with pytest.raises(DigsError, match="no object 'spot' in"):
        bench_surface(["spot"])
