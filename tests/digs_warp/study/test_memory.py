import numpy as np
import pytest

from digs_warp.study.memory import peak_growth


def test_the_peak_counts_and_not_what_is_left():
    size = 100_000_000
    found = peak_growth(lambda: np.ones(size, dtype=np.uint8).sum())
    if found is None:
        pytest.skip("no /proc here")
    assert 0.9 * size < found < 1.5 * size
    assert (peak_growth(lambda: None) or 0) < 0.1 * size
