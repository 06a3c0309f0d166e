"""The spatial filter of a device, against a float64 twin and what its formula promises."""

import numpy as np
import pytest

from digs_warp.sim.sensor.smoothing import DELTA, ITERATIONS, smooth_spatially


def twin(disparity: np.ndarray, alpha: float) -> np.ndarray:
    """The exponential moving average as Intel describes it; it restarts at steps and after holes."""
    values = disparity.astype(np.float64)
    for _ in range(ITERATIONS):
        for line in (line for lines in (values, values.T) for line in lines):
            for way in (line, line[::-1]):
                for t in range(1, len(way)):
                    if abs(way[t] - way[t - 1]) < DELTA:
                        way[t] = alpha * way[t] + (1 - alpha) * way[t - 1]
    return values


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (7, 5), (24, 300)])
def test_the_spatial_filter_is_its_twin(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    disparity = 20 + 0.1 * np.arange(shape[1]) + rng.normal(0, 0.2, shape)
    disparity[:, shape[1] // 2 :] += 5
    disparity[rng.random(shape) < 0.2] = np.nan
    for alpha in (0.5, 1.0):
        found = smooth_spatially(disparity.astype(np.float32), alpha)
        np.testing.assert_allclose(found, twin(disparity, alpha), atol=2e-5)
