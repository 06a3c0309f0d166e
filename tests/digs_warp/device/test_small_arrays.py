"""Small arrays are set where they are: with the type of the array, whatever the values have."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import warp as wp

from digs_warp.device.parallel import put, put_by_copy


@wp.struct
class Pair:
    number: int
    share: float


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


@BOTH
def test_matrices_and_structures_are_set(put: Callable[[wp.array, Any], None]) -> None:
    matrix = wp.zeros((2, 4), dtype=int, device="cpu")
    put(matrix, np.arange(8).reshape(2, 4))
    assert matrix.numpy().tolist() == [[0, 1, 2, 3], [4, 5, 6, 7]]
    form: Any = Pair
    record = np.array([(3, 0.25)], dtype=form.numpy_dtype())
    pairs = wp.zeros(1, dtype=form, device="cpu")
    put(pairs, record)
    assert pairs.numpy().tolist() == [(3, 0.25)]


@BOTH
def test_another_number_of_values_is_an_error(put: Callable[[wp.array, Any], None]) -> None:
    with pytest.raises(ValueError, match="broadcast"):
        put(wp.zeros(3, dtype=float, device="cpu"), (1.0, 2.0))
