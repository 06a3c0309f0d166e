from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose
from scipy.spatial import KDTree

from digs_warp.data.gaussians import FIELDS
from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.usd.lod import (
    KEPT_BEFORE_MERGING,
    MERGED_WIDENING,
    level_of_detail,
    merged_in_voxels,
)
from reference.capture_scenes import splats
from reference.usd_files import covariances


def test_levels_hold_about_their_share_and_drop_what_matters_least_before_merging():
    for count, share in ((1, 0.1), (20, 0.1), (3000, 0.5)):
        wanted = max(1, int(share * count))
        assert 0.8 * wanted <= len(level_of_detail(splats(count), share)) <= wanted
    gaussians = splats(100)
    level = level_of_detail(gaussians, KEPT_BEFORE_MERGING)
    radii = np.sqrt(np.sort(gaussians.scales, axis=1)[:, 1:].prod(axis=1))
    kept = gaussians.select(np.sort(np.argsort(-gaussians.opacities * radii)[:60]))
    assert all((getattr(level, name) == getattr(kept, name)).all() for name in FIELDS)


def test_a_group_becomes_the_gaussian_of_the_same_moments():
    """Against the moments of many samples of the mixture."""
    gaussians = replace(splats(5, seed=3), opacity_logits=np.array([0.0, 1.0, -1.0, 2.0, 0.5]))
    merged = merged_in_voxels(gaussians, 1)
    assert len(merged) == 1
    rng = np.random.default_rng(0)
    weights = gaussians.opacities.astype(np.float64)
    weights /= weights.sum()
    chosen = rng.choice(5, size=400_000, p=weights)
    half = matrix_from_quat_xyzw(gaussians.quats) * gaussians.scales[:, None].astype(np.float64)
    samples = gaussians.means[chosen] + np.einsum(
        "nij,nj->ni", half[chosen], rng.normal(size=(len(chosen), 3))
    )
    assert_allclose(merged.means[0], samples.mean(axis=0), atol=2e-3)
    expected = np.cov(samples.T) * MERGED_WIDENING**2
    assert_allclose(
        covariances(merged.quats, merged.scales)[0], expected, atol=0.02 * np.abs(expected).max()
    )
    assert_allclose(merged.sh[0], np.einsum("n,nkc->kc", weights, gaussians.sh), atol=1e-6)
    # As much light is blocked: opacity times area, of the two longer axes.
    before, after = (
        g.opacities @ np.prod(np.sort(g.scales)[:, 1:], axis=1) for g in (gaussians, merged)
    )
    assert_allclose(after, before, rtol=1e-5)


def test_hard_cases_come_out_finite():
    cases = {
        "invisible": replace(splats(10), opacity_logits=np.full(10, -1e4)),
        "one place": replace(splats(10), means=np.ones((10, 3))),
        "a stray far away": replace(splats(10), means=np.vstack([splats(9).means, [[1e6] * 3]])),
        "needles": replace(splats(10), log_scales=np.tile([-1.0, -30.0, -30.0], (10, 1))),
    }
    for name, gaussians in cases.items():
        level = level_of_detail(gaussians, 0.5)
        assert 1 <= len(level) <= 5, name
        assert all(np.isfinite(getattr(level, array)).all() for array in FIELDS), name


def test_who_is_alone_in_a_voxel_stays_and_nobody_is_far_from_what_is_left():
    gaussians = replace(splats(200), means=splats(200).means * [1, 4, 0.5])
    merged = merged_in_voxels(gaussians, 150)
    distances, nearest = map(np.asarray, KDTree(gaussians.means).query(merged.means))
    alone, kept = merged.select(distances == 0), gaussians.select(nearest[distances == 0])
    assert 0.8 * 150 <= len(merged) <= 150 and len(alone) > 80
    assert all((getattr(alone, name) == getattr(kept, name)).all() for name in FIELDS)
    away = KDTree(merged.means).query(gaussians.means)[0]
    assert away.mean() < 0.016 and away.max() < 0.08
