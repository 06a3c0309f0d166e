"""One flag tells whether any value of some arrays is NaN or infinite, wherever it lies."""

import numpy as np
import pytest
import warp as wp

from digs_warp.train.optimizer import CHECKED_BLOCK, FiniteCheck

EXTREME = np.array([0.0, -0.0, 1e-45, -3.4e38, 3.4e38], np.float32)


@pytest.mark.parametrize(
    ("count", "value"),
    [
        (1, np.nan),
        (CHECKED_BLOCK - 1, -np.inf),
        (CHECKED_BLOCK, np.inf),
        (2 * CHECKED_BLOCK + 5, np.nan),
    ],
)
def test_a_broken_value_is_found_wherever_it_lies(count: int, value: float) -> None:
    values = np.resize(EXTREME, count)
    array = wp.array(values, dtype=float, device="cpu")
    whole = wp.zeros(3, dtype=wp.vec3, device="cpu")
    assert FiniteCheck([array, whole]).passes()
    for place in {0, count // 2, count - 1}:
        broken = values.copy()
        broken[place] = value
        array.assign(broken)
        assert not FiniteCheck([whole, array]).passes()


def test_vectors_are_looked_at_to_their_last_component() -> None:
    values = np.zeros((10, 4, 3), np.float32)
    array = wp.array(values, dtype=wp.vec3, device="cpu")
    check = FiniteCheck([array])
    assert check.passes()
    values[9, 3, 2] = np.nan
    array.assign(values)
    assert not check.passes()
