"""Back-projection and its voxels, against the formulas."""

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.init.back_project import back_project
from digs_warp.init.voxel import MAX_INDEX, Voxels
from reference.init_twin import back_projected, voxel_means

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
