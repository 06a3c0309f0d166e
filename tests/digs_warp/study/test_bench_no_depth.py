"""The benchmark of starts without depth: each start is what its name says."""

from pathlib import Path

import pytest
import trimesh

from digs_warp.checks import DigsError
from digs_warp.sim.config import SimulateConfig
from digs_warp.study.bench_no_depth import RANDOM_POINTS, bench_no_depth


def test_the_starts_that_need_no_matching_are_measured(tmp_path: Path) -> None:
    folder = tmp_path / "meshes/avocado"
    folder.mkdir(parents=True)
    trimesh.creation.box(extents=(0.2, 0.25, 0.1)).export(folder / "avocado.glb")
    small = SimulateConfig(frames=4, width=64, samples_per_pixel=1, tier="law")
    starts = ("depth", "hull of the masks", "points of COLMAP", "random")
    results = bench_no_depth(tmp_path, ["avocado"], small, iterations=2, starts=starts)
    points = {result.labels["start"]: result.values["points"] for result in results}
    assert tuple(points) == starts
    assert points["random"] == RANDOM_POINTS
    # Those of COLMAP are the ones from depth, but for some that no view of the training shows.
    assert points["points of COLMAP"] == pytest.approx(points["depth"], rel=0.1)


def test_without_sample_meshes_it_says_what_is_missing(tmp_path: Path) -> None:
    with pytest.raises(DigsError, match=r"no sample meshes.*DIGS_WARP_SAMPLE_DATA"):
        bench_no_depth(tmp_path)
