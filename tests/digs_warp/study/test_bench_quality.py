"""The benchmarks of held-out quality on tiny recordings: options, both rates, several lengths."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.study.bench_quality import (
    DENSE,
    OPTIONS,
    REFERENCE,
    SceneSize,
    bench_convergence,
    bench_options,
    bench_paper_length,
    convergence_charts,
)
from digs_warp.study.charts import side_by_side

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def test_every_option_is_measured() -> None:
    results = bench_options(SceneSize(160, 90, frames=4, voxel_size=0.02), iterations=3)
    names = [name for name, _ in OPTIONS]
    assert [r.labels["option"] for r in results if "step [ms]" in r.values] == names
    assert all(np.isfinite(v) and v > 0 for r in results for v in r.values.values())
    start = results[0].labels["start"]
    assert {r.values["Gaussians"] for r in results} == {float(start)}


def test_both_settings_are_measured_along_the_run() -> None:
    results = bench_convergence(SceneSize(256, 144, frames=5, voxel_size=0.012), iterations=20)
    curves = {
        name: [r for r in results if r.labels["settings"] == name] for name in (DENSE, REFERENCE)
    }
    for curve in curves.values():
        assert [r.labels["iteration"] for r in curve] == [0, 10, 20]
        seconds = [r.values["seconds"] for r in curve]
        assert seconds[0] == 0.0 and seconds == sorted(seconds)
        assert all(np.isfinite(r.values["PSNR on the object [dB]"]) for r in curve)
        assert (
            curve[-1].values["PSNR on the object [dB]"] > curve[0].values["PSNR on the object [dB]"]
        )
    assert side_by_side(convergence_charts(results)).startswith(PNG_SIGNATURE)


def test_each_length_is_a_run_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DIGS_WARP_SAMPLE_DATA", str(tmp_path))
    results = bench_paper_length(SceneSize(256, 144, frames=5, voxel_size=0.012), (5, 30))
    seconds = [r.values["training [s]"] for r in results]
    quality = [r.values["PSNR on the object [dB]"] for r in results]
    assert 0 < seconds[0] < seconds[1]
    assert 15 < quality[0] < quality[1]
    assert results[0].labels["object"] == "built-in vase"
    assert [r.labels["iterations"] for r in results] == ["5", "30"]
