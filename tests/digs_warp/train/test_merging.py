"""Splats that share a pixel become one, with the moments of all of them."""

import numpy as np

from digs_warp.data.gaussians import FIELDS, Gaussians, joined
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.train.merging import finest_pixels, merged
from reference.splat_scenes import random_gaussians

COARSE = Camera(Intrinsics(40, 30, 40.0, 40.0, 20.0, 15.0), np.eye(4))
FINE = Camera(Intrinsics(80, 60, 80.0, 80.0, 40.0, 30.0), np.eye(4))


def splats(places: list[tuple[float, float, float]], deviation: float = 0.004) -> Gaussians:
    """Splats of about one deviation at pixels of the finer camera and depths."""
    px = np.array(places)
    some = random_gaussians(len(places), seed=3)
    some.means[:] = (np.c_[px[:, :2] + 0.5, px[:, :1] * 0 + 1] - [40, 30, 0]) / [80, 80, 1]
    some.means[:] *= px[:, 2:]
    some.log_scales[:] = np.log(deviation) + 0.2 * some.sh[:, 0]
    return some


def moments(g: Gaussians) -> tuple[np.ndarray, np.ndarray]:
    """Centers and covariances."""
    axes = matrix_from_quat_xyzw(g.quats.astype(np.float64)) * g.scales[:, None, :]
    return g.means.astype(np.float64), axes @ axes.transpose(0, 2, 1)


def test_two_of_a_pixel_become_one_with_their_moments() -> None:
    pair, others = splats([(7, 9, 1.0), (7, 9, 1.005)]), splats([(8, 9, 1.0), (7, 9, 1.1)])
    before = joined([others, pair])
    found = merged(before, [COARSE, FINE], np.zeros(4, bool))
    assert sorted(found.sources[found.keeps_moments]) == [0, 1]  # beside, and far behind
    (one,) = np.flatnonzero(~found.keeps_moments)
    means, covariances = moments(pair)
    widths = np.exp(pair.log_scales.mean(axis=1))
    shares = pair.opacities * widths**2 / (pair.opacities * widths**2).sum()
    mean = shares @ means
    offsets = means - mean
    wanted = np.einsum("n,nij->ij", shares, covariances + offsets[:, :, None] * offsets[:, None])
    new = found.gaussians.select(np.array([one]))
    np.testing.assert_allclose(new.means[0], mean, rtol=1e-6)
    np.testing.assert_allclose(moments(new)[1][0], wanted, rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(1 - new.opacities[0], np.prod(1 - pair.opacities), rtol=1e-4)
    np.testing.assert_allclose(new.sh[0], np.einsum("n,nkc->kc", shares, pair.sh), rtol=1e-5)
    for name in FIELDS:
        kept = getattr(found.gaussians, name)[found.keeps_moments]
        sources = found.sources[found.keeps_moments]
        np.testing.assert_array_equal(kept, getattr(before, name)[sources])


def test_held_splats_and_those_that_no_view_shows_stay() -> None:
    pair = splats([(7, 9, 1.0), (7, 9, 1.0)])
    for some, held in ((pair, True), (splats([(7, 900, 1.0)] * 2), False)):
        assert merged(some, [FINE], np.full(2, held)).keeps_moments.all()


def test_the_finest_view_counts() -> None:
    found, depths = finest_pixels(splats([(7, 9, 1.5)]).means, [COARSE, FINE, COARSE])
    assert found.tolist() == [40 * 30 + 9 * 80 + 7] and depths[0] == np.float32(1.5)
