from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from reference.capture_scenes import camera_path, splats

from digs_warp.gaussians import Gaussians
from digs_warp.splat.render import render
from usd.lod import LEVELS, importance, level_of_detail


def test_full_is_everything_and_comes_first():
    gaussians = splats(20)
    assert next(iter(LEVELS.values())) == 1.0
    assert level_of_detail(gaussians, 1.0) is gaussians


@pytest.mark.parametrize(
    ("count", "share", "kept"), [(20, 0.5, 10), (20, 0.1, 2), (1, 0.1, 1), (0, 0.5, 0)]
)
def test_levels_keep_their_share(count: int, share: float, kept: int):
    assert len(level_of_detail(splats(count), share)) == kept


def test_importance_is_opacity_times_the_two_longer_axes():
    gaussians = replace(
        splats(2),
        log_scales=np.log([[0.1, 0.001, 0.4], [0.2, 0.2, 0.2]]),
        opacity_logits=np.array([0.0, 100.0]),
    )
    assert_allclose(importance(gaussians), [0.5 * 0.2, 0.2], rtol=1e-6)


def test_kept_splats_stay_in_order_and_only_grow():
    gaussians = splats(50)
    level = level_of_detail(gaussians, 0.5)
    places = [int(np.flatnonzero((gaussians.means == mean).all(axis=1))[0]) for mean in level.means]
    assert places == sorted(places)
    assert_array_equal(level.sh, gaussians.sh[places])
    growth = level.log_scales - gaussians.log_scales[places]
    assert_allclose(growth, growth[0, 0], atol=1e-6)
    assert growth[0, 0] > 0


def test_invisible_splats_have_a_level_too():
    gaussians = replace(splats(10), opacity_logits=np.full(10, -1e4))
    level = level_of_detail(gaussians, 0.5)
    assert len(level) == 5
    assert np.isfinite(level.log_scales).all()


@pytest.mark.parametrize("share", [0.5, 0.1])
def test_a_level_looks_more_like_all_splats_than_a_random_choice(share: float):
    # A few large faint splats and many small opaque ones, as training leaves them.
    rng = np.random.default_rng(0)
    gaussians = replace(
        splats(600, degree=0),
        log_scales=rng.normal(np.log(0.01), 0.7, (600, 3)),
        opacity_logits=rng.normal(0.0, 2.0, 600),
    )
    views = camera_path(views=3).cameras

    def error(other: Gaussians) -> float:
        pairs = [(render(gaussians, view).image, render(other, view).image) for view in views]
        return float(np.mean([((a - b) ** 2).mean() for a, b in pairs]))

    chosen = error(level_of_detail(gaussians, share))
    count = round(share * 600)
    for seed in range(3):
        keep = np.sort(np.random.default_rng(seed).permutation(600)[:count])
        assert chosen < 0.8 * error(gaussians.select(keep))
