"""Adam against its float64 twin (Kingma and Ba 2015, algorithm 1), and the rates of the groups."""

from dataclasses import astuple

import numpy as np
import pytest

from digs_warp.splat.device import DeviceGaussians
from digs_warp.train.config import Density, DensityStrategy, Stop, TrainConfig
from digs_warp.train.optimizer import BLOCK, Adam
from reference.splat_scenes import random_gaussians

STEPS = 5


def adam_twin(value: np.ndarray, gradients: list[np.ndarray], rates: list[float]) -> np.ndarray:
    """Return the value after one step per gradient."""
    value = value.astype(np.float64)
    first, second = np.zeros_like(value), np.zeros_like(value)
    for step, (gradient, rate) in enumerate(zip(gradients, rates, strict=True), start=1):
        first = 0.9 * first + 0.1 * gradient
        second = 0.999 * second + 0.001 * gradient**2
        mean = first / (1 - 0.9**step)
        variance = second / (1 - 0.999**step)
        value = value - rate * mean / (np.sqrt(variance) + 1e-15)
    return value


def adam_of(
    gaussians: DeviceGaussians,
    config: TrainConfig,
    extent: float,
    gradients: DeviceGaussians | None = None,
) -> Adam:
    """Return the optimizer of a run; without gradients, there are none."""
    given = gradients or gaussians.zeros_like()
    return Adam(gaussians, given, config.learning_rates, extent)


@pytest.mark.parametrize("block", [BLOCK, 1])
def test_five_steps_equal_the_twin(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    # A GPU has a thread for each value.
    monkeypatch.setattr("digs_warp.train.optimizer.values_per_thread", lambda *_: block)
    # 1500 Gaussians: every group crosses the kernel's blocks of 4096 values at another place.
    start = random_gaussians(1500, seed=0, degree=2)
    gaussians = DeviceGaussians.from_numpy(start)
    gradients = gaussians.zeros_like()
    adam = adam_of(gaussians, TrainConfig(stop=Stop(iterations=10)), 2.0, gradients)
    rng = np.random.default_rng(0)
    given: list[list[np.ndarray]] = []
    rates = []
    for step in range(STEPS):
        given.append([rng.normal(size=array.numpy().shape) for array in gradients.arrays])
        for array, value in zip(gradients.arrays, given[-1], strict=True):
            array.assign(value.astype(np.float32))
        rates.append(adam.rates(step / 10))
        adam.update(step / 10)
    before = (start.means, start.log_scales, start.quats, start.opacity_logits, start.sh)
    for group, value in enumerate(before):
        history = [step[group].reshape(value.shape) for step in given]
        expected = adam_twin(value, history, [step[group] for step in rates])
        if value is start.sh:  # higher bands learn at a twentieth
            slower = adam_twin(value, history, [step[group] / 20 for step in rates])
            expected[:, 1:] = slower[:, 1:]
        found = gaussians.arrays[group].numpy().reshape(value.shape)
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6)


def test_short_runs_from_sparse_points_learn_as_fast_as_dense_ones() -> None:
    def rates(steps: int, strategy: DensityStrategy = "adaptive") -> list[float]:
        config = TrainConfig(stop=Stop(iterations=steps), density=Density(strategy=strategy))
        return [*astuple(config.learning_rates)]

    dense, reference = (rates(30_000, strategy) for strategy in ("fixed", "adaptive"))
    assert rates(1000) == pytest.approx(dense) == rates(100)
    assert rates(100_000) == reference == [1.6e-4, 5e-3, 1e-3, 5e-2, 2.5e-3]
    halfway = round((1000 * 30_000) ** 0.5)
    expected = [(a * b) ** 0.5 for a, b in zip(dense, reference, strict=True)]
    assert rates(halfway) == pytest.approx(expected, rel=1e-3)


def test_rates_of_a_dense_start_fall_to_a_share() -> None:
    gaussians = DeviceGaussians.from_numpy(random_gaussians(3, seed=0))
    config = TrainConfig(stop=Stop(iterations=100), learning_rate=2.0)
    adam = adam_of(gaussians, config, 1.0)
    start = np.array(adam.rates(0.0))
    assert start[4] == 0.04
    for progress, share in ((0.5, 1.0), (0.75, 0.525), (1.0, 0.05)):
        assert adam.rates(progress)[1:] == pytest.approx(start[1:] * share)
    assert adam.rates(1.0)[0] == pytest.approx(start[0] / 100)


def test_held_gaussians_stay_where_they_are_and_the_others_do_not_notice() -> None:
    start = random_gaussians(300, seed=0, degree=1)
    held = np.arange(300) % 3 == 0
    results = []
    for rows in (np.zeros(300, bool), held):
        gaussians = DeviceGaussians.from_numpy(start)
        gradients = gaussians.zeros_like()
        adam = adam_of(gaussians, TrainConfig(stop=Stop(iterations=10)), 2.0, gradients)
        adam.hold(rows)
        for array in gradients.arrays:
            array.fill_(1e3)
        for _ in range(STEPS):
            adam.update(0.0)
        results.append(gaussians.to_numpy())
    free, mixed = results
    for name in ("means", "log_scales", "quats", "opacity_logits", "sh"):
        values = getattr(mixed, name)
        np.testing.assert_array_equal(values[held], getattr(start, name)[held])
        np.testing.assert_array_equal(values[~held], getattr(free, name)[~held])
        assert (values[~held] != getattr(start, name)[~held]).any()


@pytest.mark.parametrize(("name", "row", "value"), [("means", 0, np.nan), ("sh", -1, np.inf)])
def test_a_parameter_that_is_no_longer_finite_is_noticed(name: str, row: int, value: float) -> None:
    start = random_gaussians(BLOCK + 3, seed=0, degree=0)
    gaussians = DeviceGaussians.from_numpy(start)
    adam = adam_of(gaussians, TrainConfig(), 2.0)
    adam.update(0.0)
    assert adam.is_finite
    values = getattr(start, name).copy()
    values[row] = value
    for given in (values, getattr(start, name)):  # once False, it stays False
        getattr(gaussians, name).assign(given)
        adam.update(0.0)
        assert not adam.is_finite
