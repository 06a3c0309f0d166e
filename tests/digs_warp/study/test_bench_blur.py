"""The benchmark of motion blur: what is compared, on recordings with more and less of it."""

from pathlib import Path

import pytest
import trimesh

from digs_warp.checks import DigsError
from digs_warp.sim.config import SimulateConfig
from digs_warp.study.bench_blur import COST, DRAWN, GAIN, IGNORED, PIXELS, measure_objects, medians


def test_drawn_and_ignored_blur_stand_side_by_side(tmp_path: Path) -> None:
    folder = tmp_path / "meshes/spot"
    folder.mkdir(parents=True)
    trimesh.creation.box(extents=(0.4, 0.5, 0.3)).export(folder / "spot.glb")
    small = SimulateConfig(frames=4, width=96, height=54, samples_per_pixel=1)
    rows = measure_objects(tmp_path, ["spot"], small, iterations=2, recordings=("blur x8.0",))
    assert [row.labels for row in rows] == [{"object": "spot", "recording": "blur x8.0"}]
    values = rows[0].values
    assert values[PIXELS] > 0.5
    assert values[DRAWN] != values[IGNORED]
    assert values[GAIN] == pytest.approx(values[DRAWN] - values[IGNORED])
    assert values[COST] > 0
    (median,) = medians([*rows, *rows])
    assert median.values == values and median.table == "medians"


def test_without_sample_meshes_the_blur_bench_says_what_is_missing(tmp_path: Path) -> None:
    with pytest.raises(DigsError, match=r"bench blur: no sample meshes.*DIGS_WARP_SAMPLE_DATA"):
        measure_objects(tmp_path)
