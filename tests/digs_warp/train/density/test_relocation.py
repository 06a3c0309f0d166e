"""Monte-Carlo density control against its formulas: relocation, growth, noise."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.config import EXPLORE, Density, TrainConfig
from digs_warp.train.density.control import MonteCarlo
from digs_warp.train.density.mcmc import (
    DEAD_OPACITY,
    MAX_COPIES,
    relocate,
    shared_by_copies,
)
from reference.density_twin import brightness_along_a_line, noise, relocated


def population(opacities: np.ndarray) -> Gaussians:
    rng = np.random.default_rng(0)
    count = len(opacities)
    return Gaussians(
        means=rng.normal(size=(count, 3)),
        log_scales=rng.uniform(-5, -3, (count, 3)),
        quats=rng.normal(size=(count, 4)),
        opacity_logits=np.log(opacities / (1 - opacities)),
        sh=rng.normal(size=(count, 1, 3)),
    )


@pytest.mark.parametrize(
    ("opacity", "copies"),
    [(0.01, 1), (0.01, MAX_COPIES), (0.3, 2), (0.3, 20), (0.9, 5), (0.999, 2), (0.999, MAX_COPIES)],
)
def test_opacity_and_scale_of_copies_are_those_of_the_paper(opacity: float, copies: int) -> None:
    each, scales = shared_by_copies(np.array([opacity]), np.full((1, 3), 0.02), np.array([copies]))
    expected_opacity, expected_scale = relocated(opacity, 0.02, copies)
    assert each[0] == pytest.approx(max(expected_opacity, DEAD_OPACITY), rel=1e-9)
    if expected_opacity > DEAD_OPACITY:
        np.testing.assert_allclose(scales, expected_scale, rtol=1e-6)


@pytest.mark.parametrize("copies", [2, 7, 30])
def test_copies_look_together_as_the_one_did(copies: int) -> None:
    """What the formula is for: the alpha along a line through them keeps its integral."""
    opacity, scale = 0.8, 0.02
    each, scales = shared_by_copies(np.array([opacity]), np.full((1, 3), scale), np.array([copies]))
    one = brightness_along_a_line(opacity, scale, 1)
    many = brightness_along_a_line(float(each[0]), float(scales[0, 0]), copies)
    assert many == pytest.approx(one, rel=1e-6)


def test_the_dead_move_to_the_living_in_proportion_to_opacity() -> None:
    dead = np.full(3000, 0.001)
    before = population(np.concatenate([[0.2, 0.6], dead]))
    result = relocate(before, max_splats=3002, random=np.random.default_rng(0))
    assert result is not None
    moved = result.sources[2:]
    assert set(moved) == {0, 1}
    assert np.mean(moved == 1) == pytest.approx(0.75, abs=0.03)
    np.testing.assert_array_equal(result.gaussians.means, before.means[result.sources])
    assert not result.keeps_moments.any()  # both hosts changed as well


def test_a_host_shares_with_those_that_come() -> None:
    before = population(np.array([0.001, 0.5, 0.001]))
    result = relocate(before, max_splats=3, random=np.random.default_rng(0))
    assert result is not None
    expected, _ = relocated(0.5, 1.0, 3)
    np.testing.assert_allclose(result.gaussians.opacities, expected, rtol=1e-5)
    np.testing.assert_allclose(
        result.gaussians.scales, np.tile(result.gaussians.scales[1], (3, 1)), rtol=1e-6
    )


def test_who_is_alone_stays_as_it_is() -> None:
    opacities = np.full(200, 0.5)
    opacities[7] = 0.001
    before = population(opacities)
    result = relocate(before, max_splats=200, random=np.random.default_rng(3))
    assert result is not None
    host = result.sources[7]
    others = np.setdiff1d(np.arange(200), [7, host])
    for name in FIELDS:
        np.testing.assert_array_equal(
            getattr(result.gaussians, name)[others], getattr(before, name)[others]
        )
    np.testing.assert_array_equal(np.flatnonzero(~result.keeps_moments), sorted([7, host]))


@pytest.mark.parametrize(("cap", "expected"), [(100, 100), (103, 103), (1000, 105), (50, 100)])
def test_growth_is_five_percent_up_to_the_cap(cap: int, expected: int) -> None:
    before = population(np.full(100, 0.5))
    result = relocate(before, cap, np.random.default_rng(0))
    assert len(before if result is None else result.gaussians) == expected


def test_nothing_lives() -> None:
    assert relocate(population(np.full(5, 1e-4)), 10, np.random.default_rng(0)) is None


def test_opacities_of_one_and_floods_of_copies_stay_finite() -> None:
    before = population(np.concatenate([[0.5], np.full(500, 1e-4)]))
    before = replace(before, opacity_logits=np.concatenate([[40.0], np.full(500, -40.0)]))
    result = relocate(before, 501, np.random.default_rng(0))
    assert result is not None
    assert all(np.isfinite(getattr(result.gaussians, name)).all() for name in FIELDS)
    assert (result.gaussians.opacities >= DEAD_OPACITY * 0.999).all()


def test_the_noise_is_that_of_the_paper() -> None:
    before = population(np.array([0.004, 0.01, 0.03, 0.5, 0.02]))
    before = replace(before, quats=before.quats * np.array([1, 1, 0, 1, 3])[:, None])
    device = DeviceGaussians.from_numpy(before)
    config = TrainConfig(density=Density(strategy="mcmc"), seed=4)
    extent, rate = 1.7, 1.3e-4
    assert MonteCarlo(config, extent, 10).after_update(device, 7, rate) is None
    draws = np.random.default_rng([4, EXPLORE, 7]).standard_normal((5, 3), dtype=np.float32)
    moved = device.means.numpy().astype(np.float64) - before.means
    expected = [
        noise(
            before.quats[i].astype(np.float64),
            before.log_scales[i],
            float(before.opacity_logits[i]),
            draws[i],
            rate,
            extent,
        )
        for i in range(5)
    ]
    np.testing.assert_allclose(moved, expected, rtol=1e-3, atol=1e-7)
