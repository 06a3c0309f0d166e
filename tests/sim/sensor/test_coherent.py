"""Random fields on some pixels: their distribution, their reach, and that they repeat."""

import numpy as np
import pytest

from digs_warp.sim.sensor.coherent import coherent_normal, coherent_uniform
from digs_warp.sim.sensor.steps import find_runs, find_steps

SHAPE = (240, 320)
ROWS, COLUMNS = (axis.ravel() for axis in np.indices(SHAPE))


def field(seed: int, cell: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return coherent_normal(rng, SHAPE, ROWS, COLUMNS, cell).reshape(SHAPE)


@pytest.mark.parametrize("cell", [1.0, 6.0, 13.7])
def test_every_pixel_has_unit_variance(cell: float) -> None:
    """Also between the lattice points, where plain interpolation would flatten the field."""
    values = np.stack([field(seed, cell) for seed in range(60)])
    assert values.mean() == pytest.approx(0, abs=0.02)
    assert values.std() == pytest.approx(1, abs=0.02)
    assert values.std(axis=0).min() > 0.55


def test_neighbours_agree_within_a_cell_and_not_beyond() -> None:
    values = np.stack([field(seed, 12.0) for seed in range(10)])
    near = np.mean(values[..., :-3] * values[..., 3:])
    far = np.mean(values[..., :-30] * values[..., 30:])
    assert near > 0.8 and abs(far) < 0.05


def test_uniform_values_are_uniform() -> None:
    drawn = np.concatenate(
        [coherent_uniform(np.random.default_rng(s), SHAPE, ROWS, COLUMNS, 4.0) for s in range(5)]
    )
    shares, _ = np.histogram(drawn, bins=10, range=(0, 1))
    np.testing.assert_allclose(shares / drawn.size, 0.1, atol=0.01)


def test_a_pixel_has_the_same_value_whatever_else_is_asked() -> None:
    everything = field(3, 8.0)
    some = coherent_normal(
        np.random.default_rng(3), SHAPE, np.array([5, 200]), np.array([319, 0]), 8.0
    )
    assert some.tolist() == [everything[5, 319], everything[200, 0]]


def test_steps_know_their_near_and_far_side() -> None:
    disparity = np.array([[5.0, 5.0, 20.0, 20.0, 5.0, np.nan, 9.0]], np.float32)
    steps, none = find_steps(disparity, 2.0)
    assert steps.near.tolist() == [2, 3] and steps.far.tolist() == [1, 4]
    assert steps.away.tolist() == [-1, 1] and steps.rows.tolist() == [0, 0]
    assert none.rows.size == 0
    none, steps = find_steps(np.ascontiguousarray(disparity.T), 2.0)
    assert none.rows.size == 0 and steps.rows.tolist() == [0, 0]
    assert steps.near.tolist() == [2, 3] and steps.far.tolist() == [1, 4]


@pytest.mark.parametrize("shape", [(1, 1), (2, 2), (7, 150)])
def test_steps_are_found_in_reading_order_along_their_axis(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(5)
    disparity = rng.choice([1.0, 2.0, 9.0, np.nan], shape, p=[0.4, 0.3, 0.2, 0.1]).astype(
        np.float32
    )
    for steps, view in zip(find_steps(disparity, 2.0), (disparity, disparity.T), strict=True):
        jump = np.diff(view, axis=1)
        rows, left = np.nonzero(np.abs(jump) > 2)
        np.testing.assert_array_equal(steps.rows, rows)
        np.testing.assert_array_equal(np.minimum(steps.near, steps.far), left)
        assert (view[steps.rows, steps.near] > view[steps.rows, steps.far]).all()


def test_runs_and_their_pixels_are_the_mask() -> None:
    marked = np.random.default_rng(0).random((40, 60)) < 0.4
    marked[3] = True
    runs = find_runs(marked)
    rows, columns, run = runs.pixels()
    again = np.zeros_like(marked)
    again[rows, columns] = True
    np.testing.assert_array_equal(again, marked)
    assert runs.lengths.sum() == marked.sum() == len(run)
    assert not marked[runs.rows, np.maximum(runs.first - 1, 0)][runs.first > 0].any()
    assert find_runs(np.zeros((4, 5), dtype=bool)).rows.size == 0
