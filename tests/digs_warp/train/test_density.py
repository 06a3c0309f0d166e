"""Clone, split, prune, reset and merge do what is described, and moments follow their Gaussians."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from digs_warp.data.gaussians import FIELDS, Gaussians, joined
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.train.density import (
    GRADIENT_LIMIT,
    MIN_OPACITY,
    RESET_OPACITY,
    Refinement,
    Schedule,
    refine,
    unchanged,
    with_low_opacities,
)
from digs_warp.train.merging import finest_cells, merged
from reference.splat_scenes import random_gaussians

EXTENT = 2.0
SMALL, LARGE, HUGE = np.log(0.004), np.log(0.05), np.log(0.5)  # around 0.01 and 0.1 of the extent


def population(count: int, log_scale: float = SMALL, opacity_logit: float = 0.0) -> Gaussians:
    rng = np.random.default_rng(0)
    return Gaussians(
        means=rng.normal(size=(count, 3)),
        log_scales=rng.uniform(-0.5, 0.0, (count, 3)) + log_scale,
        quats=rng.normal(size=(count, 4)),
        opacity_logits=np.full(count, opacity_logit),
        sh=rng.normal(size=(count, 4, 3)),
    )


def refined(gaussians: Gaussians, gradients: np.ndarray, **options: Any) -> Refinement:
    settings: dict[str, Any] = {
        "limit": GRADIENT_LIMIT,
        "extent": EXTENT,
        "max_splats": 1000,
        "remove_large": False,
        "random": np.random.default_rng(1),
    }
    return refine(gaussians, gradients, **(settings | options))


def pulled(count: int, *indices: int) -> np.ndarray:
    gradients = np.zeros(count)
    gradients[list(indices)] = 2 * GRADIENT_LIMIT
    return gradients


def assert_rows_equal(a: Gaussians, rows: slice, b: Gaussians, sources: list[int]) -> None:
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(a, name)[rows], getattr(b, name)[sources])


def test_a_small_gaussian_is_cloned() -> None:
    before = population(6)
    result = refined(before, pulled(6, 1, 4))
    assert_rows_equal(result.gaussians, slice(None), before, [0, 1, 2, 3, 4, 5, 1, 4])
    np.testing.assert_array_equal(result.keeps_moments, [True] * 6 + [False] * 2)


def test_a_large_gaussian_is_split_along_itself() -> None:
    """Children are smaller by 1.6, and lie where the parent's own distribution puts them."""
    count = 4000
    one = population(1, LARGE)
    before = Gaussians(*(np.repeat(getattr(one, name), count, axis=0) for name in FIELDS))
    result = refined(before, np.full(count, 1.0), max_splats=2 * count)
    children = result.gaussians
    assert len(children) == 2 * count
    assert not result.keeps_moments.any()
    np.testing.assert_array_equal(result.sources, np.tile(np.arange(count), 2))
    np.testing.assert_allclose(
        children.scales, np.tile(one.scales / 1.6, (2 * count, 1)), rtol=1e-6
    )
    axes = matrix_from_quat_xyzw(one.quats[0]) * one.scales[0]
    measured = np.cov(children.means.T, bias=True)
    np.testing.assert_allclose(measured, axes @ axes.T, atol=0.05 * np.max(axes**2))
    np.testing.assert_allclose(children.means.mean(axis=0), one.means[0], atol=0.003)


def test_a_childs_place_belongs_to_its_parent() -> None:
    """Other Gaussians that split as well change nothing."""
    before = population(5, LARGE)
    alone, together = refined(before, pulled(5, 3)), refined(before, pulled(5, 1, 3))
    first_alone = alone.gaussians.means[alone.sources == 3]
    first_together = together.gaussians.means[together.sources == 3]
    np.testing.assert_array_equal(first_alone, first_together)


def test_the_transparent_and_the_huge_are_removed() -> None:
    before = population(5)
    logits, log_scales = before.opacity_logits.copy(), before.log_scales.copy()
    logits[[0, 3]] = np.log(MIN_OPACITY) - 0.01
    log_scales[1, 2] = HUGE
    some = replace(before, opacity_logits=logits, log_scales=log_scales)
    # The clone of 3 goes with it; the huge stay until opacities were reset.
    np.testing.assert_array_equal(refined(some, pulled(5, 3)).sources, [1, 2, 4])
    np.testing.assert_array_equal(refined(some, np.zeros(5), remove_large=True).sources, [2, 4])
    faint = replace(population(4), opacity_logits=np.array([-9.0, -8.0, -12.0, -9.0]))
    np.testing.assert_array_equal(refined(faint, np.zeros(4)).sources, [1])  # the most opaque


@pytest.mark.parametrize("room", [0, 3])
def test_the_cap_is_kept_and_the_largest_gradients_come_first(room: int) -> None:
    before = population(20)
    gradients = np.linspace(1, 2, 20)[::-1] * GRADIENT_LIMIT
    result = refined(before, gradients, max_splats=20 + room)
    assert len(result.gaussians) == 20 + min(room, 20)
    np.testing.assert_array_equal(result.sources[20:], np.arange(min(room, 20)))


def test_a_reset_pushes_opacities_down_only() -> None:
    before = replace(population(3), opacity_logits=np.array([-6.0, 0.0, 5.0]))
    result = with_low_opacities(unchanged(before))
    opacities = result.gaussians.opacities
    np.testing.assert_allclose(
        opacities, [before.opacities[0], RESET_OPACITY, RESET_OPACITY], rtol=1e-5
    )
    moments = np.ones(3)
    np.testing.assert_array_equal(result.moments("opacity_logits", moments), 0.0)
    np.testing.assert_array_equal(result.moments("means", np.ones((3, 3))), 1.0)


def test_the_schedule_is_that_of_the_reference_and_short_runs_refine_more_often() -> None:
    def steps(schedule: Schedule) -> list[int]:
        return [step for step in range(1, schedule.iterations + 1) if schedule.refines(step)]

    long, resets = Schedule(30_000), (3001, 6001, 9001, 12_001)
    assert steps(long) == [*range(600, 15_001, 100)]
    # After what is measured or written at a round number.
    assert [step for step in range(1, 30_001) if long.resets(step)] == [*resets]
    assert steps(Schedule(1000)) == [*range(150, 501, 50)]
    assert steps(Schedule(300)) == [*range(45, 151, 15)]
    assert steps(Schedule(60)) == [10, 20, 30]
    assert Schedule(2000).every == long.every == 100


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


def test_two_of_a_cell_become_one_with_their_moments() -> None:
    # A cell holds one and a quarter pixels.
    pair, others = splats([(5, 8, 1.0), (5.7, 8, 1.005)]), splats([(6.9, 8, 1.0), (5, 8, 1.1)])
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
    found, depths = finest_cells(splats([(5, 9, 1.5)]).means, [COARSE, FINE, COARSE])
    assert found.tolist() == [32 * 24 + 7 * 64 + 4] and depths[0] == np.float32(1.5)
