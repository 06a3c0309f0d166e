"""Numbers that no float or no JSON file can hold."""

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.record.files import to_json
from digs_warp.record.typed import from_json
from digs_warp.sim.config import SimulateConfig


@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan, np.array([1.0, np.inf])])
def test_json_with_a_number_that_is_not_finite_is_a_clear_error(value: float | np.ndarray) -> None:
    with pytest.raises(DigsError, match=r"finite numbers only.*look for extreme"):
        to_json({"camera": [0.0, value]})


def test_a_setting_of_four_hundred_digits_is_a_clear_error() -> None:
    with pytest.raises(DigsError, match=r"settings: strength is .*expected a finite number"):
        from_json(SimulateConfig, {"strength": 10**400}, "settings", strict=True)
