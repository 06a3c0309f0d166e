"""A rolling shutter in the renderer: rows as seen from their own poses."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.splat.camera_motion import RowMotion
from digs_warp.splat.render import render
from reference.splat_scenes import BACKGROUND, NEAR, camera, random_gaussians

SOME = random_gaussians(30, seed=2)
GAUSSIANS = replace(SOME, log_scales=SOME.log_scales - np.float32(np.log(10.0)))
VIEW = camera(96, 80, fx=96.0, fy=96.0)
HAND = RowMotion(np.array([0.02, -0.03, 0.01]), np.array([0.004, 0.003, -0.006]))


def drawn(rows: RowMotion | None = None, view=VIEW) -> np.ndarray:
    return render(GAUSSIANS, view, near=NEAR, background=tuple(BACKGROUND), rows=rows).image


def test_every_row_is_that_of_a_camera_at_its_moment() -> None:
    """A splat of a few rows has one pose: close to the truth, not equal."""
    height = VIEW.intrinsics.height
    rows = [drawn(view=HAND.at(VIEW, (y + 0.5) / height - 0.5))[y] for y in range(height)]
    left = np.abs(drawn(HAND) - np.stack(rows)).mean()
    ignored = np.abs(drawn() - np.stack(rows)).mean()
    assert left < 0.1 * ignored


def test_motions_that_cannot_be_are_named() -> None:
    with pytest.raises(DigsError, match=r"turn: .*NaN"):
        RowMotion(np.full(3, np.nan), np.zeros(3))
    with pytest.raises(DigsError, match=r"shift: shape \(2,\)"):
        RowMotion(np.zeros(3), np.zeros(2))
