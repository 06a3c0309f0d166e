"""Grids whose edge lengths double."""

import numpy as np

from digs_warp.init.levels import Levels, count, finest_of
from digs_warp.init.voxel import Voxels, voxel_keys


def plate(edge: float, side: float) -> Voxels:
    """One voxel for each cell of a square of the plane z = edge / 2, with its corner at the origin."""
    steps = np.arange(0.5 * edge, side, edge)
    points = np.stack(np.meshgrid(steps, steps, [0.5 * edge]), axis=-1).reshape(-1, 3)
    keys = voxel_keys(points, edge)
    order = np.argsort(keys)
    ones = np.ones((len(points), 1))
    sums = np.concatenate([ones, points, np.zeros_like(points)], axis=1)
    return Voxels(edge, keys[order], sums[order])


def test_the_grid_for_a_depth_is_as_wide_as_the_pixels_there() -> None:
    levels = Levels(finest=0.002, pixels=2.0)
    depth = np.array([0.1, 0.5, 1.0, 2.0, 4.1, np.nan])
    numbers = levels.of_depth(depth, focal=500.0)
    assert numbers.tolist() == [0, 0, 1, 2, 3, 0]
    for number, z in zip(numbers[1:5], depth[1:5], strict=True):
        assert 2**-0.5 < levels.edge(number) / (2 * z / 500) < 2**0.5


def test_coarse_voxels_under_fine_ones_are_dropped_and_others_stay() -> None:
    fine, coarse = plate(0.01, 0.2), plate(0.02, 0.4)
    kept = finest_of([fine, coarse])
    assert len(kept[0]) == 400
    # A quarter of the large square lies under the small one.
    assert len(kept[1]) == 400 - 100
    assert count(kept) == 700
    # The two squares touch the same plane at other heights; what counts is the cell.
    assert (kept[1].points_world[:, :2].max(axis=1) > 0.2).all()


def test_several_grids_cover_together() -> None:
    coarse, middle, fine = plate(0.04, 0.04), plate(0.02, 0.04), plate(0.01, 0.04)
    a_quarter = middle.select(np.arange(4) < 1)
    corner = np.all(fine.points_world[:, :2] > 0.02, axis=1)
    another = fine.select(corner)
    assert len(coarse.uncovered_by([a_quarter])) == 1
    assert len(coarse.uncovered_by([another])) == 1
    assert len(coarse.uncovered_by([a_quarter, another])) == 0
