"""Runs of several lengths on a tiny recording: longer ones take longer and are better."""

from pathlib import Path

import pytest

from digs_warp.study.bench_paper_length import bench_paper_length
from digs_warp.study.training_case import SceneSize


def test_each_length_is_a_run_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DIGS_WARP_SAMPLE_DATA", str(tmp_path))
    results = bench_paper_length(SceneSize(256, 144, frames=5, voxel_size=0.012), (5, 30))
    seconds = [r.value for r in results if r.name == "training"]
    quality = [r.value for r in results if r.name == "held-out PSNR"]
    assert 0 < seconds[0] < seconds[1]
    assert 15 < quality[0] < quality[1]
    assert results[0].settings["object"] == "built-in vase"
    assert [r.settings["iterations"] for r in results[::2]] == ["5", "30"]
