"""Gaussians packed for the page: what comes out is what went in, to within the steps."""

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.sh import C0
from digs_warp.show.report.view3d.pack import pack
from reference.unpacked_splats import unpacked
from reference.usd_files import covariances


def some_gaussians(count: int = 3000) -> Gaussians:
    rng = np.random.default_rng(3)
    return Gaussians(
        rng.normal(size=(count, 3)) * [1.0, 5.0, 100.0],
        rng.uniform(-9.0, -2.0, (count, 3)),
        rng.normal(size=(count, 4)) * 3.0,
        rng.normal(size=count) * 2.0,
        rng.normal(size=(count, 4, 3)) * 0.4,
    )


def test_what_is_unpacked_is_what_was_packed() -> None:
    g = some_gaussians()
    g.quats[:4] = np.eye(4) * [[-2.0], [1.0], [-1.0], [5.0]]
    packed = pack(g)
    found = unpacked(packed)
    assert len(packed) == packed.total == len(g)
    extent = g.means.max(axis=0) - g.means.min(axis=0)
    assert (np.abs(found.centers - g.means) < extent / 2**24 + 1e-5).all()
    true = covariances(g.quats, g.scales)
    size = np.trace(true, axis1=1, axis2=2)[:, None, None]
    assert np.abs((found.covariances - true) / size).max() < 0.04  # steps of 2.7 % in a length
    rgb = np.clip(0.5 + C0 * g.sh[:, 0], 0, 1)
    np.testing.assert_allclose(found.colors, rgb, atol=0.5 / 255 + 1e-6)
    np.testing.assert_allclose(found.opacities, g.opacities, atol=0.5 / 255 + 1e-6)


def test_the_highest_harmonics_go_before_any_gaussian_then_those_that_cover_the_least() -> None:
    g = some_gaussians()
    whole = pack(g)
    assert len(whole.to_bytes()) == len(g) * (20 + 9)
    wrong = np.abs(unpacked(whole).harmonics - g.sh[:, 1:])
    assert np.quantile(wrong, 0.998) < 0.51 * whole.harmonic_step and wrong.max() < 1.0
    assert whole.harmonic_step < 0.02
    less = pack(g, most_bytes=len(g) * 25 * 4 // 3)
    assert (len(less), less.harmonics.shape[1]) == (len(g), 0)
    least = pack(g, most_bytes=1000 * 20 * 4 // 3)
    assert (len(least), least.total, least.harmonics.shape) == (999, 3000, (999, 0, 3))
    area = g.opacities * np.exp(np.sort(g.log_scales, axis=1)[:, 1:].sum(axis=1))
    kept = np.sort(np.argsort(-area)[:999])
    np.testing.assert_allclose(unpacked(least).centers, g.means[kept], atol=1e-4)


def test_flat_boxes_zero_quaternions_and_broken_values_are_fine() -> None:
    g = some_gaussians(50)
    g.means[:] = 1.5
    g.log_scales[:] = -4.0
    g.quats[:] = 0.0
    g.means[7, 1] = np.nan
    g.sh[9] = np.inf
    found = unpacked(pack(g))
    assert len(found.centers) == 48
    np.testing.assert_allclose(found.centers, 1.5, atol=1e-6)
    round_ones = np.exp(-8.0) * np.eye(3)
    np.testing.assert_allclose(
        found.covariances, np.tile(round_ones, (48, 1, 1)), rtol=5e-3, atol=3e-6
    )
