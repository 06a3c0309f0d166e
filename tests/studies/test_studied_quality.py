"""The benchmark of held-out quality on a tiny recording: our settings and those of 3DGS."""

import numpy as np

from studies.convergence import DENSE, REFERENCE, SceneSize, bench_convergence, convergence_charts


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
    assert len(convergence_charts(results)) == 2
