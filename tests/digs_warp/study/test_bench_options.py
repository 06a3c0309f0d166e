"""The benchmark of the training's options on a tiny recording."""

import numpy as np

from digs_warp.study.bench_options import OPTIONS, bench_options
from digs_warp.study.training_case import SceneSize


def test_every_option_is_measured() -> None:
    results = bench_options(SceneSize(160, 90, frames=4, voxel_size=0.02), iterations=3)
    names = [name for name, _ in OPTIONS]
    assert [r.settings["option"] for r in results if r.unit == "ms"] == names
    assert all(np.isfinite(r.value) and r.value > 0 for r in results)
    start = results[0].settings["start"]
    assert {r.value for r in results if r.name == "Gaussians"} == {float(start)}
