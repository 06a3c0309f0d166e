"""A room before the simulated D435, beside planes before a real one (d435_planes of the sample data)."""

from functools import cache

import numpy as np
import pytest

from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.fit.device_figures import WINDOWS, Holes, holes, roughness
from digs_warp.sim.record.record import simulate_in_memory

# Residuals to a plane at 1.2 m in windows of 8 to 64 px [px], and holes.
REAL: dict[int, float] = dict(zip(WINDOWS, (0.020, 0.033, 0.071, 0.106), strict=True))
REAL_HOLES = Holes(share=0.067, per_10000=10.5, small=0.020)


@cache
def disparity() -> np.ndarray:
    """Two frames of the built-in room in disparity of the depth camera [px], NaN where there is none."""
    config = SimulateConfig(profile="d435", width=848, frames=2, samples_per_pixel=1)
    capture = simulate_in_memory(config)
    depth = np.stack([frame.load_depth() for frame in capture.frames])
    return 424.0 * 0.05 / np.where(np.isfinite(depth), depth, np.nan)


@pytest.mark.parametrize("size", WINDOWS[:3])
def test_planes_are_as_rough_as_the_devices(size: int) -> None:
    at_distance = roughness(disparity(), size).median(424 * 0.05 / 1.4, 424 * 0.05 / 1.0)
    assert abs(np.log(at_distance / REAL[size])) < np.log(1.4)


def test_holes_are_as_many_and_as_small_as_the_devices() -> None:
    found = [holes(frame) for frame in disparity()]
    for name, real in vars(REAL_HOLES).items():
        mean = np.mean([getattr(each, name) for each in found])
        assert abs(np.log(mean / real)) < np.log(1.6), name
