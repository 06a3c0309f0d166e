"""Small arrays are set where they are: with the type of the array, whatever the values have."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import warp as wp

from digs_warp.device.parallel import put, put_by_copy

BOTH = pytest.mark.parametrize("put", [put, put_by_copy])  # the second is for GPUs


@BOTH
@pytest.mark.parametrize("values", [(1, 2.5, 1 / 3), np.array([1, 2.5, 1 / 3], np.float64)])
def test_values_are_those_of_assign(
    put: Callable[[wp.array, Any], None], values: np.ndarray
) -> None:
    array, other = (wp.zeros(3, dtype=float, device="cpu") for _ in range(2))
    place = array.ptr
    put(array, values)
    other.assign(np.array(values, np.float32))
    np.testing.assert_array_equal(array.numpy(), other.numpy())
    assert array.ptr == place, "kernels hold the address"
