"""What the right eye cannot see, with as few rays as possible."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.right_eye import HIDDEN, SEEN, UNSURE
from digs_warp.sim.sensor.right_eye import classify as classify_some
from reference.right_eye_twin import classified
from reference.stereo_frames import CountedRays, make_frame

SHAPE = (240, 320)


def classify(disparity: np.ndarray, opaque: np.ndarray) -> np.ndarray:
    """The classes of all pixels."""
    return classify_some(disparity, opaque, np.ones(disparity.shape, bool))


@dataclass
class NoRays(CountedRays):
    """Remembers for which pixels rays were asked; they all see their point."""

    count: int = 0

    def right_visibility(
        self, where: np.ndarray | None = None, depth: np.ndarray | None = None
    ) -> np.ndarray:
        assert where is not None
        self.count += int(np.count_nonzero(where))
        return np.ones(self.shape, dtype=bool)


def step(near: float = 40.0, far: float = 10.0) -> np.ndarray:
    disparity = np.full(SHAPE, far)
    disparity[80:160, 100:220] = near
    return disparity


def test_the_strip_left_of_a_near_square_is_hidden_without_rays() -> None:
    truth = replace(make_frame(step()), rays=NoRays(SHAPE))
    hidden = truth.hidden
    assert (hidden.sum(axis=1)[80:160] >= 30 - 3).all() and (hidden.sum(axis=1) <= 30).all()
    assert hidden[80:160, 72:98].all() and not hidden[:80].any()
    assert isinstance(truth.rays, NoRays) and truth.rays.count < 4 * 80


def test_what_stands_behind_glass_is_not_hidden_for_sure() -> None:
    truth = make_frame(step())
    ids = (step() > 20).astype(np.int32)
    glass = Material("glass", np.ones(3), transmission=1.0)
    truth = replace(
        truth, material_ids=ids, materials=(*truth.materials, glass), rays=NoRays(SHAPE)
    )
    assert not truth.hidden.any()


def test_long_rows_are_classified_as_point_by_point() -> None:
    """Most of these rows is passed over block by block; a ball, a thin rod and a far wall behind them."""
    columns, rows = np.meshgrid(np.arange(300.0), np.arange(24.0))
    disparity = np.round((8 + 0.01 * columns + 0.02 * rows) * 64) / 64
    ball = np.hypot(columns - 210, 4 * (rows - 12)) < 50
    disparity[ball] = 31.25
    disparity[:, 130:133] = 17.5
    disparity[:, 40:60] = np.round((12 + 0.7 * np.arange(20)) * 64) / 64  # flat rising slope
    disparity[20:, 280:] = np.nan
    disparity[:4, :40] = (
        np.round((np.arange(40) + 0.05 * rows[:4, :40] - 0.3) * 64) / 64
    )  # the left border
    opaque = disparity.copy()
    opaque[5:9, 180:200] = np.nan
    expected = classified(disparity, opaque)
    np.testing.assert_array_equal(classify(disparity, opaque), expected)
    assert {HIDDEN, UNSURE, SEEN} == set(expected.ravel().tolist())


@pytest.mark.parametrize("width", [1, 15, 16, 90, 300])
def test_pixels_that_nobody_asks_for_count_as_seen_and_change_nothing(width: int) -> None:
    rng = np.random.default_rng(width)
    disparity = (rng.integers(0, 64 * 12, (40, width)) / 64).astype(np.float32)
    disparity[10:30, width // 4 : width // 2] = 20.25
    where = rng.random(disparity.shape) < 0.3
    some = classify_some(disparity, disparity, where)
    np.testing.assert_array_equal(some, np.where(where, classify(disparity, disparity), SEEN))
