"""How opaque the first Gaussians are."""

import numpy as np

from digs_warp.init.config import InitConfig
from digs_warp.init.seeds import LEAST_OPACITY, SCENE_OPACITY, seed_start


def test_the_longer_the_run_the_more_opaque_are_doubtful_points() -> None:
    depth = InitConfig()
    least = [seed_start(depth, "object", steps).least for steps in (0, 300, 500, 1000, 30_000)]
    np.testing.assert_allclose(np.array(least)[[0, 1, 3, 4]], [0.1, 0.1, 0.8, 0.8], rtol=1e-12)
    assert 0.1 < least[2] < 0.8
    sparse = seed_start(InitConfig(strategy="default"), "object", 100)
    assert sparse.least == sparse.opacity == 0.1
    assert seed_start(InitConfig(opacity=0.05), "object", 100).least == 0.05


def test_a_scene_starts_less_opaque_unless_told_otherwise() -> None:
    scene = seed_start(InitConfig(), "scene", 1000)
    assert (scene.opacity, scene.least) == (SCENE_OPACITY, LEAST_OPACITY)
    assert scene.largest > seed_start(InitConfig(), "object", 1000).largest
    assert seed_start(InitConfig(opacity=0.9), "scene", 1000).opacity == 0.9
    assert seed_start(InitConfig(strategy="default"), "scene", 1000).opacity == 0.1
