"""The voxel grid against a dictionary, and its limits."""

from collections import defaultdict

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.voxel import MAX_INDEX, Voxels, merged

VOXEL = 0.0625  # a power of two: cell borders are exact


def cloud(count: int, seed: int = 0) -> PointCloud:
    rng = np.random.default_rng(seed)
    return PointCloud(rng.uniform(-0.5, 0.5, (count, 3)), rng.uniform(0, 1, (count, 3)))


def voxel_sums(points_world: np.ndarray, colors: np.ndarray, voxel_size: float) -> Voxels:
    """Each point in a separate voxel, put on the coarser grid."""
    ones = np.ones((len(points_world), 1))
    rows = np.concatenate([ones, points_world, colors], axis=1, dtype=np.float64)
    return Voxels(1.0, np.arange(len(rows)), rows).coarser(voxel_size)


def voxel_downsample(points: PointCloud, voxel_size: float) -> PointCloud:
    sums = voxel_sums(points.points_world, points.colors, voxel_size)
    return sums.points


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


def test_merging_batches_equals_one_batch() -> None:
    points = cloud(5000)
    whole = voxel_sums(points.points_world, points.colors, VOXEL)
    pieces = [voxel_sums(points.points_world[i::7], points.colors[i::7], VOXEL) for i in range(7)]
    joined = merged([merged(pieces[:3]), *pieces[3:]])
    np.testing.assert_array_equal(joined.keys, whole.keys)
    np.testing.assert_allclose(joined.sums, whole.sums, rtol=1e-13, atol=1e-13)


def test_indices_just_below_the_limit_work_and_above_it_raise() -> None:
    points = np.array([[MAX_INDEX - 0.5, 0, 0], [-MAX_INDEX + 0.5, 0, 0], [0, 0, 0]])
    assert len(voxel_sums(points / 2, points, 0.5)) == 3
    with pytest.raises(DigsError, match=r"points up to 524"):
        voxel_sums(points * 0.500005, points, 0.5)
