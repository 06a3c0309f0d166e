"""The benchmark of surfaces: fused depth and every weight on one recording, with ratios and medians."""

from pathlib import Path

import pytest

from digs_warp.sim.config import SimulateConfig
from digs_warp.study.bench_surface import FUSED, MILLIMETERS, RATIO, Scope, bench_surface
from digs_warp.study.results import tables
from digs_warp.study.scenes import BUILT_IN
from reference.optional import open3d_or_skip


def test_every_weight_stands_beside_the_fused_depth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    open3d_or_skip()
    monkeypatch.setenv("DIGS_WARP_SAMPLE_DATA", str(tmp_path))  # the built-in object alone
    small = SimulateConfig(frames=10, width=128, height=72, samples_per_pixel=1)
    scope = Scope(tiers=("truth",), weights=(0.0, 0.2), recording=small, iterations=30)
    results = bench_surface(scope)
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
