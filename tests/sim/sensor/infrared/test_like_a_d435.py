"""A room before the simulated D435 and boards before the simulated Gemini 335, beside the real ones."""

from functools import cache

import numpy as np
import pytest

from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.fit.device_figures import WINDOWS, Holes, holes, roughness
from digs_warp.sim.record.record import simulate_in_memory
from studies.device import BOARDS, _on_board, _on_edge
from studies.device_scenes import board, both, photographed

# Of d435_planes of the sample data: residuals to a plane at 1.2 m in windows of 8 to 64 px [px], and holes.
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


@pytest.mark.parametrize(("distance", "rmse"), [(0.5, 1.26), (2.0, 9.07)])
def test_boards_before_the_gemini_are_as_rough_as_published(distance: float, rmse: float) -> None:
    size = BOARDS[distance][0]
    found = _on_board(photographed(board(distance), "gemini-335"), "guided", size)
    assert found["guided: RMSE [mm]"] == pytest.approx(rmse, rel=0.2)


def test_depth_steps_before_the_gemini_are_as_sharp_as_published() -> None:
    """Of a board at 2 m, 30 cm before another: 18 % of the values within 20 px lie between the two."""
    still = photographed(both(board(2.0, right=0.0), board(2.3)), "gemini-335")
    assert _on_edge(still, "guided", 2.0)["guided: mixed"] == pytest.approx(0.176, rel=0.5)
