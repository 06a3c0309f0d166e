"""Boards and depth steps that are known in closed form."""

import numpy as np
import pytest

from studies.boards_and_edges import edge, plane_error

SHAPE = (240, 320)


def test_points_off_a_tilted_plane_are_measured_at_right_angles_to_it() -> None:
    focal, tilt = 400.0, 0.5
    columns = (np.arange(SHAPE[1]) + 0.5 - SHAPE[1] / 2) / focal
    depth = np.tile(1.0 / (1 - tilt * columns), (SHAPE[0], 1))  # z = 1 + tilt * x
    assert plane_error(depth, focal)[0] == pytest.approx(0, abs=1e-9)
    assert plane_error(depth, focal)[1] == pytest.approx(1.0)
    off = np.where(np.random.default_rng(0).random(SHAPE) < 0.5, 0.001, -0.001)
    rmse, distance = plane_error(depth + off, focal)
    assert rmse < 0.00105 and distance == pytest.approx(1.0, abs=1e-4)


def test_an_edge_is_as_wide_as_its_ramp() -> None:
    columns = np.tile(np.arange(SHAPE[1]) + 0.5, (SHAPE[0], 1))
    place = columns - 160.0
    sharp = edge(np.where(place < 0, 1.0, 1.3), place, 1.0, 1.3, 0.02)
    assert sharp.width == pytest.approx(3.2), "strips of two pixels, half of each side in one"
    assert (sharp.mixed, sharp.bleeding, sharp.missing) == (0, 0, 0)
    ramp = np.clip(1.15 + 0.3 * place / 10, 1.0, 1.3)
    ramp[:, 150] = np.nan
    wide = edge(ramp, place, 1.0, 1.3, 0.02)
    assert wide.mixed == pytest.approx(8 / 39, rel=0.2)
    assert wide.missing == pytest.approx(1 / 40)
    late = edge(np.where(place < -6, 1.0, 1.3), place, 1.0, 1.3, 0.02)
    assert late.bleeding == pytest.approx(6 / 20)
