"""The benchmark of found poses: each way has its row, and says how much it loses."""

from pathlib import Path

import pytest
import trimesh

from digs_warp.checks import DigsError
from digs_warp.sim.config import SimulateConfig
from reference.optional import open3d_or_skip
from studies.benchmarks import find_benchmark
from studies.found_poses import (
    IN_SCALE,
    LOSS,
    LOST,
    POSES_AND_TIME,
    SCENES,
    PosedScene,
    bench_found_poses,
)
from studies.recordings import FIGURES, FINDINGS, POSES


def test_every_way_has_a_row_and_its_loss_or_its_error(tmp_path: Path) -> None:
    open3d_or_skip()
    folder = tmp_path / "meshes/avocado"
    folder.mkdir(parents=True)
    trimesh.creation.box(extents=(0.2, 0.25, 0.1)).export(folder / "avocado.glb")
    scene = PosedScene("box, white room", "avocado", "white", "arc", True)
    small = SimulateConfig(frames=6, width=64, samples_per_pixel=1, tier="law")
    results = bench_found_poses(("avocado",), tmp_path, [scene], small, iterations=2)
    figures, poses = (
        [row for row in results if row.table == table] for table in (FIGURES, POSES_AND_TIME)
    )
    assert [row.labels for row in poses] == [row.labels for row in figures]
    assert [row.labels["poses"] for row in figures] == list(POSES.values())
    assert all(row.labels["kept aside"] == "yes" for row in figures)
    true = figures[0].values["PSNR [dB]"]
    assert LOSS not in figures[0].values
    failed = {row.labels["stage"] for row in results if row.table == FINDINGS}
    for row, beside in zip(figures[1:], poses[1:], strict=True):
        if f"{row.labels['poses']} poses" in failed:
            assert "PSNR [dB]" not in row.values
        else:
            assert row.values[LOSS] == pytest.approx(true - row.values["PSNR [dB]"])
            wrong = beside.values["pose error [px]"] > LOST
            assert (IN_SCALE in row.values) == (not wrong)
    assert "estimated poses" in failed  # 64 pixels are too few to match images


def test_cases_are_scenes() -> None:
    assert set(find_benchmark("poses").cases) == {scene.mesh for scene in SCENES}


def test_some_scenes_are_kept_aside() -> None:
    assert {scene.aside for scene in SCENES} == {True, False}
    assert {scene.wall for scene in SCENES} == {"textured", "repeating", "white"}


def test_without_sample_meshes_it_says_what_is_missing(tmp_path: Path) -> None:
    with pytest.raises(DigsError, match=r"poses: no sample meshes.*DIGS_WARP_SAMPLE_DATA"):
        bench_found_poses(data=tmp_path)
