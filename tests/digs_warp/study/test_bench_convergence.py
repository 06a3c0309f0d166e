"""The convergence benchmark on a tiny recording: its numbers, and its picture."""

import numpy as np

from digs_warp.study.bench_convergence import DENSE, REFERENCE, bench_convergence
from digs_warp.study.plot_convergence import plot_convergence
from digs_warp.study.training_case import SceneSize

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def test_both_settings_are_measured_along_the_run() -> None:
    results = bench_convergence(SceneSize(256, 144, frames=5, voxel_size=0.012), iterations=20)
    curves = {
        name: [r for r in results if r.settings["settings"] == name] for name in (DENSE, REFERENCE)
    }
    for curve in curves.values():
        assert [r.settings["iteration"] for r in curve] == [0, 10, 20]
        seconds = [r.settings["seconds"] for r in curve]
        assert seconds[0] == 0.0 and seconds == sorted(seconds)
        assert all(np.isfinite(r.value) for r in curve)
        assert curve[-1].value > curve[0].value
    assert plot_convergence(results).startswith(PNG_SIGNATURE)
