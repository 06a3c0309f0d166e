"""`digs-warp bench train`, on an object in a few small images: what it prints and what it writes."""

from pathlib import Path

import pytest

from digs_warp.cli import main
from digs_warp.study import bench_train
from digs_warp.study.results import read_json_lines

STAGES = ("project", "bin", "forward", "loss", "backward", bench_train.SUMS, "adam")


def test_every_stage_of_a_step_is_printed_and_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, value in {
        "SIZES": ((64, 48, 0.03), (96, 64, 0.02)),
        "FRAMES": 2,
        "WARM_UP_STEPS": 1,
        "STEPS": 2,
    }.items():
        monkeypatch.setattr(bench_train, name, value)
    path = tmp_path / "train.jsonl"
    assert main(["bench", "train", "--json", str(path)]) == 0

    results = read_json_lines(path)
    assert [result.labels["image"] for result in results] == ["64x48", "96x64"]
    splats = [result.labels["splats"] for result in results]
    assert 0 < splats[0] < splats[1], "finer voxels give more Gaussians"
    for result in results:
        assert result.labels["pairs"] > 0
        times = {name: result.values[f"{name} [ms]"] for name in ("step", *STAGES)}
        assert all(time > 0 for time in times.values()), times
        whole = sum(times[name] for name in STAGES)
        raster = times["forward"] + times["backward"]
        outside = {
            "outside raster [%]": raster,
            "outside raster with sums [%]": raster + times[bench_train.SUMS],
        }
        for name, inside in outside.items():
            assert result.values[name] == pytest.approx(100 * (1 - inside / whole)), name

    printed = capsys.readouterr().out
    assert f"2 results, also in {path}" in printed
    for word in ("64x48", "96x64", *results[0].values):
        assert word in printed, word
    for result in results:
        assert f"{result.labels['splats']:,}" in printed
