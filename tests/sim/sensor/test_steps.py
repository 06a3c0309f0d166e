"""Steps of disparity against their definition, pixel by pixel."""

import numpy as np
import pytest

from digs_warp.sim.sensor.steps import find_steps, near_steps


def rough(shape: tuple[int, int]) -> np.ndarray:
    """Disparity with steps of every size and pixels without a value, also at the rim."""
    rng = np.random.default_rng(shape[1])
    disparity = np.cumsum(rng.choice([0.0, 0.1, -0.3, 5.0, -4.0], shape), axis=1).astype(np.float32)
    disparity[rng.random(shape) < 0.1] = np.nan
    return disparity


def steps_twin(disparity: np.ndarray, threshold: float) -> list[tuple[int, int, int]]:
    """Row, near and far column of every step along the rows."""
    found = []
    for row, line in enumerate(disparity):
        for left in range(len(line) - 1):
            jump = line[left + 1] - line[left]
            if abs(jump) > threshold:
                near, far = (left + 1, left) if jump > 0 else (left, left + 1)
                found.append((row, near, far))
    return found


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 2), (3, 70), (20, 150)])
def test_steps_are_those_of_the_definition(shape: tuple[int, int]) -> None:
    disparity = rough(shape)
    along_rows, along_columns = find_steps(disparity, 1.0)
    for steps, image in ((along_rows, disparity), (along_columns, disparity.T)):
        listed = list(zip(*(a.tolist() for a in (steps.rows, steps.near, steps.far)), strict=True))
        assert listed == steps_twin(image, 1.0)


def test_pixels_near_a_step_are_those_within_the_radius_on_both_sides() -> None:
    disparity = np.zeros((9, 20), np.float32)
    disparity[:, 10:] = 7
    near = near_steps(disparity, 3.0, 2)
    assert (near == near[0]).all()
    np.testing.assert_array_equal(np.flatnonzero(near[0]), np.arange(7, 13))
