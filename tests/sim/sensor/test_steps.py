"""Steps of disparity against their definition, pixel by pixel."""

import numpy as np
import pytest

from digs_warp.sim.sensor.steps import near_steps


def rough(shape: tuple[int, int]) -> np.ndarray:
    """Disparity with steps of every size and pixels without a value, also at the rim."""
    rng = np.random.default_rng(shape[1])
    disparity = np.cumsum(rng.choice([0.0, 0.1, -0.3, 5.0, -4.0], shape), axis=1).astype(np.float32)
    disparity[rng.random(shape) < 0.1] = np.nan
    return disparity


def near_twin(disparity: np.ndarray, threshold: float, radius: int) -> np.ndarray:
    """Which pixels are that near to either side of a step along rows or columns."""
    near = np.zeros(disparity.shape, bool)
    for values, marks in ((disparity, near), (disparity.T, near.T)):
        for row, column in np.argwhere(np.abs(np.diff(values, axis=1)) > threshold):
            rows = slice(max(0, row - radius), row + radius + 1)
            marks[rows, max(0, column - radius) : column + radius + 2] = True
    return near


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 2), (3, 70), (20, 150)])
def test_steps_are_those_of_the_definition(shape: tuple[int, int]) -> None:
    disparity = rough(shape)
    for threshold, radius in ((1.0, 0), (4.5, 2)):
        found = near_steps(disparity, threshold, radius)
        np.testing.assert_array_equal(found, near_twin(disparity, threshold, radius))
