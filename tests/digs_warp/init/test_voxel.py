"""The voxel grid against a dictionary, Open3D, and its own invariants."""

from collections import defaultdict

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.voxel import MAX_INDEX, VoxelSums, merge_voxel_sums
from reference.optional import open3d_or_skip

VOXEL = 0.0625  # a power of two: cell borders are exact


def cloud(count: int, seed: int = 0) -> PointCloud:
    rng = np.random.default_rng(seed)
    return PointCloud(rng.uniform(-0.5, 0.5, (count, 3)), rng.uniform(0, 1, (count, 3)))


def voxel_sums(points_world: np.ndarray, colors: np.ndarray, voxel_size: float) -> VoxelSums:
    """Each point in a separate voxel, put on the coarser grid."""
    ones = np.ones((len(points_world), 1))
    rows = np.concatenate([ones, points_world, colors], axis=1, dtype=np.float64)
    single = VoxelSums(np.arange(len(rows)), rows)
    return single.coarser(voxel_size)


def voxel_downsample(points: PointCloud, voxel_size: float) -> PointCloud:
    sums = voxel_sums(points.points_world, points.colors, voxel_size)
    return PointCloud(sums.points_world, sums.colors)


def sorted_rows(points: PointCloud) -> np.ndarray:
    rows = np.concatenate([points.points_world, points.colors], axis=1).astype(np.float64)
    return rows[np.lexsort(np.floor(rows[:, 2::-1] / VOXEL).T)]


def brute_force(points: PointCloud, voxel_size: float) -> dict[tuple[int, ...], np.ndarray]:
    members: dict[tuple[int, ...], list[np.ndarray]] = defaultdict(list)
    for position, color in zip(points.points_world, points.colors, strict=True):
        key = tuple(int(i) for i in np.floor(position.astype(np.float64) / voxel_size))
        members[key].append(np.concatenate([position, color]).astype(np.float64))
    return {key: np.mean(rows, axis=0) for key, rows in sorted(members.items())}


def test_equals_a_dictionary_of_voxels_in_its_order() -> None:
    points = cloud(3000)
    expected = brute_force(points, VOXEL)
    found = voxel_downsample(points, VOXEL)
    rows = np.concatenate([found.points_world, found.colors], axis=1)
    # float64 sums, stored as float32.
    np.testing.assert_allclose(rows, np.array(list(expected.values())), rtol=0, atol=6e-8)


def test_equals_open3d() -> None:
    o3d = open3d_or_skip()
    # Open3D's grid starts half a voxel below the smallest point: with this corner it is ours.
    points = cloud(3000)
    corner = np.full((1, 3), -0.5 - VOXEL / 2, dtype=np.float32)
    points = PointCloud(
        np.concatenate([corner, points.points_world]), np.r_[[[0, 0, 0]], points.colors]
    )
    reference = o3d.geometry.PointCloud(
        o3d.utility.Vector3dVector(points.points_world.astype(float))
    )
    reference.colors = o3d.utility.Vector3dVector(points.colors.astype(float))
    reference = reference.voxel_down_sample(VOXEL)
    expected = PointCloud(np.asarray(reference.points), np.asarray(reference.colors))
    np.testing.assert_allclose(
        sorted_rows(voxel_downsample(points, VOXEL)), sorted_rows(expected), rtol=0, atol=1.2e-7
    )


def test_means_lie_in_their_voxels_and_no_voxel_has_two() -> None:
    found = voxel_downsample(cloud(5000), VOXEL).points_world.astype(np.float64)
    original = {tuple(i) for i in np.floor(cloud(5000).points_world.astype(float) / VOXEL)}
    cells = [tuple(i) for i in np.floor(found / VOXEL)]
    assert len(cells) == len(set(cells))
    assert set(cells) == original


def test_the_order_of_the_points_does_not_matter() -> None:
    points = cloud(5000)
    shuffled = np.random.default_rng(5).permutation(len(points))
    found = voxel_downsample(points, VOXEL)
    again = voxel_downsample(
        PointCloud(points.points_world[shuffled], points.colors[shuffled]), VOXEL
    )
    np.testing.assert_allclose(again.points_world, found.points_world, rtol=0, atol=6e-8)
    np.testing.assert_allclose(again.colors, found.colors, rtol=0, atol=6e-8)


def test_merging_batches_equals_one_batch() -> None:
    points = cloud(5000)
    whole = voxel_sums(points.points_world, points.colors, VOXEL)
    pieces = [voxel_sums(points.points_world[i::7], points.colors[i::7], VOXEL) for i in range(7)]
    merged = merge_voxel_sums([merge_voxel_sums(pieces[:3]), *pieces[3:]])
    np.testing.assert_array_equal(merged.keys, whole.keys)
    np.testing.assert_allclose(merged.sums, whole.sums, rtol=1e-13, atol=1e-13)


def test_a_coarse_voxel_averages_everything_on_one_side_of_the_origin() -> None:
    points = np.array([[1, 1, 1], [2, 2, 2], [3, 3, 3], [-1, 1, 1]], dtype=np.float32)
    colors = np.array([[0, 0, 0], [1, 0, 0], [0.5, 0, 0], [0, 1, 0]], dtype=np.float32)
    found = voxel_downsample(PointCloud(points, colors), 100.0)
    np.testing.assert_allclose(found.points_world, [[-1, 1, 1], [2, 2, 2]])
    np.testing.assert_allclose(found.colors, [[0, 1, 0], [0.5, 0, 0]])


def test_no_points_give_no_points() -> None:
    nothing = np.zeros((0, 3))
    sums = voxel_sums(nothing, nothing, 1.0)
    assert sums.points_world.shape == sums.colors.shape == (0, 3)


def test_indices_just_below_the_limit_work_and_above_it_raise() -> None:
    points = np.array([[MAX_INDEX - 0.5, 0, 0], [-MAX_INDEX + 0.5, 0, 0], [0, 0, 0]])
    assert len(voxel_sums(points, points, 1.0)) == 3
    with pytest.raises(DigsError, match=r"points up to 1\.04858e\+06 m"):
        voxel_sums(points * 1.00001, points, 1.0)


@pytest.mark.parametrize("voxel_size", [0.0, -0.004, float("nan"), float("inf")])
def test_a_voxel_size_that_is_no_length_raises(voxel_size: float) -> None:
    with pytest.raises(DigsError, match="voxel size"):
        voxel_downsample(cloud(3), voxel_size)
