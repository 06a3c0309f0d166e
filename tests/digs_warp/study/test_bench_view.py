"""The benchmark of the page: frames by size, and what watching a training adds."""

from pathlib import Path

import pytest

from digs_warp.checks import DigsError
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.study import bench_view
from digs_warp.study.bench_view import Took
from reference.tiny_capture import ball


def test_a_frame_is_drawn_and_encoded_at_each_size() -> None:
    results = bench_view.measure_drawing([ball()], sizes=((64, 36), (32, 18)), frames=3)
    assert [r.labels["image"] for r in results] == ["64x36", "32x18"]
    for r in results:
        whole = r.values["drawn [ms]"] + r.values["encoded [ms]"]
        assert r.values["frames/s"] == pytest.approx(1e3 / whole)
        assert min(r.values.values()) > 0


def test_a_training_is_compared_with_itself_alone() -> None:
    taken = {
        bench_view.ALONE: [Took(9.0, 10.0), Took(8.0, 20.0), Took(7.0, 12.0)],
        bench_view.SERVED: [Took(5.0, 15.0)],
    }
    alone, served = bench_view.compare(taken, 300)
    assert alone.values == {"seconds": 8.0, "CPU [s]": 12.0, "more CPU [%]": 0.0}
    assert served.labels == {"steps": 300, "reconstruct": bench_view.SERVED}
    assert served.values["more CPU [%]"] == pytest.approx(25.0)


def test_a_command_with_a_page_is_measured_to_its_end(tmp_path: Path) -> None:
    small = SimulateConfig(frames=6, width=48, samples_per_pixel=1, tier="law")
    simulate(small, tmp_path / "capture")
    words = ["reconstruct", str(tmp_path / "capture"), "--iterations", "3", "--out"]
    took = bench_view.run([*words, str(tmp_path / "out")], bench_view.SERVED, tmp_path)
    assert (tmp_path / "out/gaussians.npz").is_file()
    assert took.seconds > 0.1 and took.cpu_seconds > 0.1


def test_a_command_that_fails_is_quoted(tmp_path: Path) -> None:
    with pytest.raises(DigsError, match=r"bench view: .*no such"):
        bench_view.run(
            ["reconstruct", str(tmp_path / "none"), "--out", "x"], bench_view.ALONE, tmp_path
        )
