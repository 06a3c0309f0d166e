"""The benchmark of films, on a small scene: what is measured and said, not how fast it is."""

from digs_warp.device.parallel import default_threads
from digs_warp.study.bench_render import bench_render, measure_films
from digs_warp.study.benchmarks import BENCHMARKS
from reference.tiny_capture import ball


def test_frame_rates_by_size_and_threads() -> None:
    results = measure_films(ball(), sizes=((64, 36), (32, 18)), frames=3)
    threads = sorted({1, default_threads()})
    assert len(results) == 2 * 2 * len(threads)
    for rate, time in zip(results[::2], results[1::2], strict=True):
        assert rate.settings == time.settings
        assert abs(rate.value * time.value - 1e3) < 1e-6
    assert [r.settings["image"] for r in results[:: 2 * len(threads)]] == ["64x36", "32x18"]
    assert all(r.settings["splats"] == 1500 and r.settings["sh_degree"] == 0 for r in results)


def test_it_is_on_the_list() -> None:
    benchmark = next(b for b in BENCHMARKS if b.name == "render")
    assert benchmark.function == f"{bench_render.__module__}:{bench_render.__name__}"
