"""Voxels: back-projection into them and coarser ones against float64 twins, and the size that is taken."""

import logging
from dataclasses import replace

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.init import levels
from digs_warp.init.back_project import back_project
from digs_warp.init.config import InitConfig
from digs_warp.init.levels import Levels, count, finest_of
from digs_warp.init.recipes import Start, initialize
from digs_warp.init.voxel import MAX_INDEX, Voxels, merged, voxel_keys
from reference.ball_capture import INTRINSICS, RADIUS, radii
from reference.init_twin import back_projected, voxel_means
from reference.larger_world import larger

HEIGHT, WIDTH = 17, 31
CAMERA = Camera(
    Intrinsics(WIDTH, HEIGHT, 40.0, 42.0, 14.0, 9.5),
    look_at(np.array([0.6, -0.5, 0.4]), np.zeros(3), np.array([0.0, 0.0, 1.0])),
)
TINY = 2e-5  # no two of the test's points fall into one voxel of this size


def random_view(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth, image and pixels to keep; about half of the pixels are not kept, some of them have no depth."""
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.3, 3.0, (HEIGHT, WIDTH)).astype(np.float32)
    keep = rng.random((HEIGHT, WIDTH)) < 0.5
    depth[~keep & (rng.random((HEIGHT, WIDTH)) < 0.3)] = np.nan
    image = rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    return depth, image, keep


def check_against_twin(found: Voxels, points: np.ndarray, values: np.ndarray, size: float) -> None:
    expected = voxel_means(points, values, size)
    np.testing.assert_array_equal(found.sums[:, 0], [count for count, _ in expected.values()])
    # float64 sums in both: a few roundings of coordinates up to 3.
    means = found.sums[:, 1:] / found.sums[:, :1]
    np.testing.assert_allclose(means, [mean for _, mean in expected.values()], atol=1e-12)


@pytest.mark.parametrize("voxel_size", [TINY, 0.4, 100.0])
def test_voxels_equal_the_twin(voxel_size: float) -> None:
    depth, image, keep = random_view()
    points = back_projected(CAMERA, depth, keep)
    values = np.concatenate([points, image[keep] / 255.0], axis=1)
    found = back_project(CAMERA, image, depth, keep, voxel_size)
    check_against_twin(found, points, values, voxel_size)
    if voxel_size == TINY:
        assert len(found) == np.count_nonzero(keep)
    if voxel_size == 100.0:
        assert len(found) <= 8  # the voxels around the origin


def test_more_voxels_than_the_table_starts_with() -> None:
    camera = Camera(Intrinsics(300, 200, 200.0, 200.0, 150.0, 100.0), np.eye(4))
    rng = np.random.default_rng(4)
    depth = rng.uniform(0.5, 3.0, (200, 300)).astype(np.float32)
    image = np.zeros((200, 300, 3), np.uint8)
    found = back_project(camera, image, depth, np.ones(depth.shape, bool), 1e-4)
    assert len(found) > 40_000
    assert found.sums[:, 0].sum() == depth.size
    assert np.all(np.diff(found.keys) > 0)


def test_points_too_far_for_the_grid_raise() -> None:
    depth, image, keep = random_view()
    far = np.where(keep, depth * np.float32(1e6), depth)
    assert len(back_project(CAMERA, image, far, keep, 10.0)) > 0
    with pytest.raises(DigsError, match=r"voxel size 0\.004 m: too small for a camera 0\.6 m"):
        back_project(CAMERA, image, far, keep, 0.004)
    assert 3e6 / 10.0 < MAX_INDEX < 3e6 / 0.004


VOXEL = 0.0625  # a power of two: cell borders are exact


def cloud(count: int, seed: int = 0) -> PointCloud:
    rng = np.random.default_rng(seed)
    return PointCloud(rng.uniform(-0.5, 0.5, (count, 3)), rng.uniform(0, 1, (count, 3)))


def voxel_sums(points_world: np.ndarray, colors: np.ndarray, voxel_size: float) -> Voxels:
    """Each point in a separate voxel, put on the coarser grid."""
    ones = np.ones((len(points_world), 1))
    rows = np.concatenate([ones, points_world, colors], axis=1, dtype=np.float64)
    return Voxels(1.0, np.arange(len(rows)), rows).coarser(voxel_size)


def test_equals_a_dictionary_of_voxels_in_its_order() -> None:
    points = cloud(3000)
    values = np.concatenate([points.points_world, points.colors], axis=1, dtype=np.float64)
    found = voxel_sums(points.points_world, points.colors, VOXEL)
    check_against_twin(found, points.points_world.astype(np.float64), values, VOXEL)


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
    depth = np.array([0.1, 0.5, 1.0, 1.5, 4.1, np.nan])
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


def edge_length(found: Start) -> float:
    assert found.depth is not None
    return found.depth.voxel_size


@pytest.mark.parametrize("factor", [0.05, 30.0])
def test_the_default_voxel_is_two_pixels_whatever_the_size(
    ball_ring: Capture, factor: float
) -> None:
    frames = [larger(frame, factor) for frame in ball_ring.frames]
    found = initialize(frames, InitConfig())
    pixel = 0.75 / INTRINSICS.fx  # the middle of the ball's near side is 0.7 m away, its rim 0.85 m
    assert edge_length(found) == pytest.approx(2 * factor * pixel, rel=0.1)
    same = initialize(ball_ring.frames, InitConfig())
    assert len(found.points) == pytest.approx(len(same.points), rel=0.02)
    given = initialize(frames, InitConfig(voxel_size=0.02 * factor))
    assert edge_length(given) == 0.02 * factor


def test_the_default_voxel_grows_where_there_would_be_too_many_points(
    ball_ring: Capture, caplog, monkeypatch
) -> None:
    usual = initialize(ball_ring.frames, InitConfig())
    wanted = len(usual.points) // 3
    monkeypatch.setattr(levels, "MOST_POINTS", wanted)
    caplog.set_level(logging.INFO)
    fewer = initialize(ball_ring.frames, InitConfig())
    assert 0.7 * wanted < len(fewer.points) <= wanted
    assert edge_length(fewer) > edge_length(usual)
    assert "--voxel-size" in caplog.text
    # Of images that show more than such voxels resolve, some of the pixels are read.
    monkeypatch.setattr(levels, "MOST_POINTS", len(usual.points) // 8)
    few = initialize(ball_ring.frames, InitConfig())
    assert few.depth is not None and usual.depth is not None
    assert 3 * few.depth.pixels["in the mask"] < usual.depth.pixels["in the mask"]
    np.testing.assert_allclose(radii(few.points.points_world), RADIUS, atol=0.01)
    # What somebody asks for is not corrected.
    fine = initialize(ball_ring.frames, InitConfig(voxel_size=edge_length(usual)))
    assert len(fine.points) == len(usual.points)


@pytest.mark.parametrize("wanted", [50, 1500])
def test_the_voxel_size_for_a_number_of_points(ball_ring: Capture, wanted: int) -> None:
    found = initialize(ball_ring.frames, InitConfig(target_points=wanted))
    assert 0.7 * wanted < len(found.points) <= wanted
    np.testing.assert_allclose(radii(found.points.points_world), RADIUS, atol=0.02)


def test_a_world_far_from_its_origin(ball_ring: Capture) -> None:
    """Recordings in geographic coordinates have their object a thousand kilometres away."""
    shift = np.eye(4)
    shift[:3, 3] = [1e6, -1e6, 1e3]
    moved = [
        replace(f, camera=replace(f.camera, world_from_cam=shift @ f.camera.world_from_cam))
        for f in ball_ring.frames
    ]
    points = initialize(moved, InitConfig(voxel_size=1.0)).points.points_world
    assert 8 <= len(points) <= 16
    assert np.abs(points - shift[:3, 3]).max() < 0.3
    with pytest.raises(DigsError, match="too small for a camera"):
        initialize(moved, InitConfig(voxel_size=0.004))
