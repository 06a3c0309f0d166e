"""The benchmark of sizes: every setting on every mesh, with the sizes that its name says."""

from pathlib import Path

import pytest
import trimesh

from digs_warp.checks import DigsError
from digs_warp.sim.config import SimulateConfig
from digs_warp.study.bench_size import SETTINGS, bench_size


def test_every_setting_is_measured(tmp_path: Path) -> None:
    folder = tmp_path / "meshes/avocado"
    folder.mkdir(parents=True)
    trimesh.creation.box(extents=(0.2, 0.25, 0.1)).export(folder / "avocado.glb")
    small = SimulateConfig(frames=4, width=64, samples_per_pixel=1, tier="law")
    results = bench_size(tmp_path, recording=small, iterations=2)
    found = {result.labels["setting"]: result.values for result in results}
    assert set(found) == set(SETTINGS)
    made, kept, followed = (found[name] for name in SETTINGS)
    assert made["diameter [m]"] == pytest.approx(2 * kept["diameter [m]"])
    assert made["voxel [mm]"] == kept["voxel [mm]"] == 4.0
    assert followed["voxel [mm]"] > 10  # two of few pixels
    assert min(made["Gaussians"], kept["Gaussians"]) > followed["Gaussians"] > 0


def test_without_sample_meshes_it_says_what_is_missing(tmp_path: Path) -> None:
    with pytest.raises(DigsError, match=r"no sample meshes.*DIGS_WARP_SAMPLE_DATA"):
        bench_size(tmp_path)
