"""The benchmark of file formats, on a small scene: the order of what they take and lose."""

from dataclasses import replace

import numpy as np

from digs_warp.study.bench_splat_files import FORMATS, bench_splat_files, measure_formats
from digs_warp.study.benchmarks import BENCHMARKS
from reference.tiny_capture import ball


def test_exact_formats_lose_nothing_and_small_ones_little() -> None:
    g = ball()
    waves = 0.1 * np.sin(g.means @ np.arange(9.0).reshape(3, 3))  # some view dependence
    sh = np.concatenate([g.sh, np.repeat(waves[:, None], 3, axis=1)], axis=1)
    results = measure_formats(replace(g, sh=sh), view_size=(96, 54))
    assert len(results) == 4 * len(FORMATS)
    values = {(r.settings["format"], r.name): r.value for r in results}
    assert values["npz", "PSNR"] == values["PLY", "PSNR"] == 100  # dB: equal to the last bit
    assert values["USD", "PSNR"] > 80
    assert 32.0 == values[".splat", "size"] < values["PLY", "size"]
    assert values["SPZ 3", "size"] < values["PLY", "size"] / 4
    for name in ("SPZ 2", "SPZ 3", "SPZ 4", ".splat"):
        assert 25 < values[name, "PSNR"] < 80
    assert values["SPZ 2", "size"] < values["SPZ 3", "size"]  # quaternions of 3 bytes, not 4


def test_it_is_on_the_list() -> None:
    benchmark = next(b for b in BENCHMARKS if b.name == "splat-files")
    assert benchmark.function == f"{bench_splat_files.__module__}:{bench_splat_files.__name__}"
