"""What goes beyond the paper: visibility, and the shape of the first Gaussians."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import look_at, matrix_from_quat_xyzw
from digs_warp.init.config import InitConfig
from digs_warp.init.normals import FLATNESS, REACH, normals_from_depth
from digs_warp.init.recipes import initialize
from digs_warp.init.seeds import quats_from_z_to, seed_gaussians
from digs_warp.init.visibility import DepthViews, not_seen_through
from reference.ball_capture import INTRINSICS, RADIUS, ball_views, write_capture
from reference.init_twin import normals_of


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return write_capture(tmp_path_factory.mktemp("ball"), ball_views(12))


def directions(points: PointCloud) -> np.ndarray:
    return points.points_world / np.linalg.norm(points.points_world, axis=1, keepdims=True)


# Visibility.


def test_visibility_equals_a_loop_over_points_and_views(capture: Capture) -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.5, 0.5, (300, 3))
    views = [(frame.camera, frame.load_depth()[::2, ::2]) for frame in capture.frames]
    expected = []
    for point in points:
        balance = 0
        for camera, depth in views:
            px, z = camera.resized(40, 30).project(point)
            if z > 0 and 0 <= px[0] < 40 and 0 <= px[1] < 30:
                measured = float(depth[int(px[1]), int(px[0])])
                tolerance = 2 * 0.004 + 0.01 * measured
                balance += int(abs(measured - z) <= tolerance) - int(measured - z > tolerance)
        expected.append(balance >= 0)
    found = not_seen_through(points, DepthViews.of(views), 0.004)
    np.testing.assert_array_equal(found, expected)
    # Points in the ball are hidden from all, those around it (and in the images) are seen through.
    distance = np.linalg.norm(points, axis=1)
    assert found[distance < 0.15].all()
    assert not found[(distance > 0.25) & (np.abs(points[:, 2]) < 0.2)].any()


def test_points_of_noisy_depth_are_less_sure(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    shares = []
    for number, noise in enumerate((0.0, 0.02)):
        views = ball_views(12)
        for _, images in views:
            images.depth[:] += noise * rng.normal()
        capture = write_capture(tmp_path / str(number), views)
        points = initialize(capture.frames, InitConfig(voxel_size=0.01)).points
        assert points.agreement is not None
        shares.append(np.median(points.agreement))
    assert shares[1] < 0.6 * shares[0]


def test_floaters_before_the_object_are_removed(tmp_path: Path) -> None:
    """One view reports a patch of the object much too near; all others see through it."""
    views = ball_views(12)
    views[0][1].depth[25:35, 35:45] = 0.5
    capture = write_capture(tmp_path, views)
    config = InitConfig(edge_filter=False, visibility_check=False)
    plain = initialize(capture.frames, config).points.points_world
    checked = initialize(capture.frames, replace(config, visibility_check=True))
    assert np.linalg.norm(plain, axis=1).max() > 0.35
    assert np.linalg.norm(checked.points.points_world, axis=1).max() < RADIUS + 0.005
    assert len(checked.points) > 0.95 * (len(plain) - 100)
    assert checked.depth is not None
    assert checked.depth.voxels["not alone"] == len(checked.points)


# Shapes.


def test_normals_of_a_slanted_plane() -> None:
    camera = Camera(
        Intrinsics(40, 30, 50.0, 52.0, 19.0, 16.0),
        look_at(np.array([1.0, 0.5, 0.8]), np.zeros(3), np.array([0.0, 0.0, 1.0])),
    )
    normal = np.array([0.6, 0.3, np.sqrt(1 - 0.45)])
    rays = camera.unproject(pixel_centers(40, 30), np.ones((30, 40))) - camera.center_world
    depth = (-(camera.center_world @ normal) / (rays @ normal)).astype(np.float32)
    found = normals_from_depth(camera, depth, np.ones(depth.shape, bool))
    known = np.linalg.norm(found, axis=-1) > 0
    assert known[3:-3, 3:-3].all() and not known[:3].any() and not known[:, -3:].any()
    # Tangents of about 0.1 m, depth rounded to float32.
    np.testing.assert_allclose(found[known], np.broadcast_to(normal, found[known].shape), atol=1e-5)


@pytest.mark.parametrize("shape", [(30, 40), (7, 7), (6, 40), (1, 1)])
def test_normals_equal_their_twin(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(5)
    rows, columns = np.indices(shape)
    depth = 1.0 + 0.2 * np.sin(0.2 * rows) * np.cos(0.3 * columns) + 1e-3 * rng.normal(size=shape)
    depth[rng.random(shape) < 0.02] = np.nan
    camera = Camera(
        Intrinsics(shape[1], shape[0], 50.0, 52.0, 19.0, 16.0),
        look_at(np.array([1.0, 0.5, 0.8]), np.zeros(3), np.array([0.0, 0.0, 1.0])),
    )
    wanted = rng.random(shape) < 0.7
    found = normals_from_depth(camera, depth.astype(np.float32), wanted)
    expected = np.where(wanted[..., None], normals_of(camera, depth.astype(np.float32), REACH), 0.0)
    # Differences of points at 1 m over a tenth of a metre, in float32.
    np.testing.assert_allclose(found, np.nan_to_num(expected), atol=2e-5)


def test_normals_next_to_holes_are_unknown() -> None:
    camera = Camera(INTRINSICS, np.eye(4))
    depth = np.ones((60, 80), np.float32)
    depth[30, 40] = np.nan
    found = normals_from_depth(camera, depth, np.ones(depth.shape, bool))
    unknown = np.argwhere(np.linalg.norm(found, axis=-1) == 0)
    inner = [(v, u) for v, u in unknown.tolist() if 3 <= v < 57 and 3 <= u < 77]
    assert inner == [(27, 40), (30, 37), (30, 43), (33, 40)]


def test_flat_gaussians_lie_along_the_ball(capture: Capture) -> None:
    found = initialize(capture.frames, InitConfig(shape="flat", voxel_size=0.02))
    points = found.points
    assert points.axes_world is not None and points.axis_deviations is not None
    cosines = np.sum(points.axes_world * directions(points), axis=1)
    assert np.median(cosines) > 0.995 and np.percentile(cosines, 2) > 0.9
    np.testing.assert_allclose(points.axis_deviations, FLATNESS * 0.02)
    gaussians = seed_gaussians(points)
    thin = matrix_from_quat_xyzw(gaussians.quats)[:, :, 2]
    np.testing.assert_allclose(thin, points.axes_world, atol=1e-6)
    np.testing.assert_allclose(gaussians.scales[:, 2], FLATNESS * 0.02, rtol=1e-6)
    assert np.all(gaussians.scales[:, 0] == gaussians.scales[:, 1])
    assert np.median(gaussians.scales[:, 0]) > 3 * FLATNESS * 0.02


def test_rotations_take_z_to_any_direction() -> None:
    axes = np.random.default_rng(4).normal(size=(200, 3))
    axes = np.vstack([axes, np.eye(3), -np.eye(3)])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    quats = quats_from_z_to(axes)
    np.testing.assert_allclose(np.linalg.norm(quats, axis=1), 1.0)
    np.testing.assert_allclose(matrix_from_quat_xyzw(quats)[:, :, 2], axes, atol=1e-12)


@pytest.mark.parametrize("shape", ["round", "flat"])
def test_points_are_saved_with_their_shape(capture: Capture, tmp_path: Path, shape: str) -> None:
    config = InitConfig(shape=shape)  # pyright: ignore[reportArgumentType]
    points = initialize(capture.frames, config).points
    points.save(tmp_path / "points.npz")
    again = PointCloud.load(tmp_path / "points.npz")
    for name in ("points_world", "colors", "axes_world", "axis_deviations"):
        np.testing.assert_array_equal(getattr(again, name), getattr(points, name))


def test_broken_point_files_are_named(tmp_path: Path) -> None:
    path = tmp_path / "points.npz"
    with pytest.raises(DigsError, match="no such file"):
        PointCloud.load(path)
    PointCloud(np.zeros((5, 3)), np.zeros((5, 3))).save(path)
    path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(DigsError, match=r"points\.npz.*expected an \.npz"):
        PointCloud.load(path)


def test_an_axis_needs_its_deviation() -> None:
    with pytest.raises(DigsError, match="belong together"):
        PointCloud(np.zeros((1, 3)), np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))
