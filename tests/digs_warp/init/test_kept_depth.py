"""Which depth becomes points: edges, the object's range, and points alone in the air are left out."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.init import depth_points, view_points
from digs_warp.init.config import InitConfig
from digs_warp.init.edges import edge_magnitude, smooth_depth
from digs_warp.init.foreground import EVERYTHING, foreground_range, two_means
from digs_warp.init.recipes import initialize
from digs_warp.init.view_points import shows_whole, thinned, thinned_object_depth
from digs_warp.init.visibility import not_isolated
from reference.ball_capture import RADIUS, ball_views, write_capture
from reference.init_twin import laplacian_of_pairs, threshold_of

# A plane of about 2 m in float32: 44 weighted differences of values with a step of 1.2e-7 * 2.
PLANE_ROUNDING = 1e-4


def plane(height: int = 24, width: int = 32) -> np.ndarray:
    rows, columns = np.mgrid[:height, :width]
    return (1.0 + 0.013 * columns - 0.021 * rows).astype(np.float32)


def step(height: int = 24, width: int = 32) -> np.ndarray:
    depth = plane(height, width)
    depth[:, width // 2 :] += 1.0
    return depth


# Tiles are 64x16 pixels: none, one, and several of them, whole and cut.
@pytest.mark.parametrize(
    ("shape", "holes"),
    [((1, 1), 0.0), ((17, 65), 0.04), ((17, 65), 0.999), ((40, 130), 0.0), ((40, 130), 0.5)],
)
def test_the_kernel_equals_its_twin(shape: tuple[int, int], holes: float) -> None:
    rng = np.random.default_rng(shape[0] + int(1000 * holes))
    depth = rng.uniform(0.5, 2.0, shape).astype(np.float32)
    depth[rng.random(shape) < holes] = np.nan
    magnitude, threshold = edge_magnitude(depth)
    expected = laplacian_of_pairs(depth)
    # Up to 20 differences of 2 m with weights up to 8 in float32, scaled up by at most 4 / 3.
    np.testing.assert_allclose(magnitude, expected, atol=PLANE_ROUNDING)
    np.testing.assert_allclose(threshold, threshold_of(expected), atol=PLANE_ROUNDING, rtol=1e-5)


def test_pixels_within_two_of_a_step_are_dropped_and_the_others_kept() -> None:
    smooth = smooth_depth(step())
    part = (slice(3, 7), slice(10, 20))
    np.testing.assert_array_equal(smooth_depth(step(), part), smooth[part])
    edge_columns = slice(14, 18)  # the step lies between columns 15 and 16
    assert not smooth[:, edge_columns].any()
    assert smooth[2:-2, 2:14].all()
    assert smooth[2:-2, 18:-2].all()


OBJECT = (slice(10, 30), slice(15, 45))


def scene(
    object_depth: float = 0.9, background: float = 4.0, noise: float = 0.0, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """An object of some depth before a background of some depth, and its mask."""
    rng = np.random.default_rng(seed)
    depth = rng.uniform(background - 0.5, background + 0.5, (40, 60))
    mask = np.zeros((40, 60), dtype=bool)
    mask[OBJECT] = True
    depth[OBJECT] = rng.uniform(object_depth - 0.2, object_depth + 0.2, (20, 30))
    # Stereo noise grows with the square of the distance.
    return (depth + noise * depth**2 * rng.normal(size=depth.shape)).astype(np.float32), mask


def brute_force(values: np.ndarray) -> tuple[float, float]:
    """Means of the split with the smallest summed squared distances."""
    splits = [
        (
            np.sum((low - low.mean()) ** 2) + np.sum((high - high.mean()) ** 2),
            low.mean(),
            high.mean(),
        )
        for low, high in (np.split(values, [k]) for k in range(1, len(values)))
    ]
    _, low, high = min(splits)
    return float(low), float(high)


def kept_of(depth: np.ndarray, found: tuple[np.float32, np.float32]) -> np.ndarray:
    return (depth >= found[0]) & (depth <= found[1])


@pytest.mark.parametrize("seed", range(2))
def test_the_split_is_the_best_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    # Fewer than a hundred values: none is trimmed.
    values = np.sort(np.append(rng.normal(1.0, 0.2, 50), rng.normal(2.0, 0.4, 40)))
    assert two_means(values) == pytest.approx(brute_force(values), rel=1e-12)


def test_the_border_is_three_times_nearer_to_the_background_also_in_a_large_view() -> None:
    depth, mask = scene()
    near, far = two_means(np.sort(depth.ravel())) or (0.0, 0.0)
    border = near + 0.75 * (far - near)
    assert foreground_range(depth, mask)[1] == pytest.approx(border)
    below = np.repeat(np.arange(40) > 34, 60).reshape(40, 60)  # only the background
    large = (np.kron(layer, np.ones((20, 20), layer.dtype)) for layer in (depth, below))
    assert foreground_range(*large)[0] == pytest.approx(near + 0.25 * (far - near), rel=0.02)
    # An empty mask means the nearer cluster.
    assert foreground_range(depth, np.zeros_like(mask))[1] == pytest.approx(border)


@pytest.mark.parametrize("strength", [0, 4])
def test_a_leak_is_found_and_the_object_kept_whatever_the_noise(strength: int) -> None:
    depth, mask = scene(noise=0.002 * strength)  # a ZED 2: 0.0012 at strength 1
    leaking = mask.copy()
    leaking[25:, 40:] = True
    kept = kept_of(depth, foreground_range(depth, leaking)) & leaking
    np.testing.assert_array_equal(kept, mask)


def test_background_nearer_than_the_object_is_left_out() -> None:
    depth, mask = scene(object_depth=3.0, background=0.8)
    leaking = mask | (np.arange(60) > 50)
    kept = kept_of(depth, foreground_range(depth, leaking)) & leaking
    np.testing.assert_array_equal(kept, mask)


@pytest.mark.parametrize("mask_share", ["exact", "half"])
def test_an_object_without_measured_background_is_not_cut_in_two(mask_share: str) -> None:
    depth, mask = scene()
    depth[~mask] = np.nan
    depth[:, 30:] += np.float32(0.5)  # two parts, one behind the other
    if mask_share == "half":
        mask[:, 31:] = False
        mask[:, 38:45] = mask[:, 20:27]
    found = foreground_range(depth, mask)
    assert found == EVERYTHING
    assert np.count_nonzero(kept_of(depth, found)) == 600


VOXEL = 0.004


def cloth(side: float = 0.2, spacing: float = VOXEL) -> np.ndarray:
    """A square of points, about as voxels leave them."""
    steps = np.arange(0, side, spacing)
    grid = np.stack(np.meshgrid(steps, steps, [0.0]), axis=-1).reshape(-1, 3)
    return grid + np.random.default_rng(0).uniform(-0.3, 0.3, grid.shape) * spacing


def test_points_away_from_everything_are_dropped() -> None:
    strays = np.array([[2.0, 0, 0], [0, 0, -1.5], [0.1, 0.1, 0.2], [3, 3, 3], [3, 3, 3.01]])
    points = np.concatenate([cloth(), strays])
    np.testing.assert_array_equal(not_isolated(points), np.arange(len(points)) < len(cloth()))
    wire = np.zeros((50, 3))  # one voxel thick
    wire[:, 2] = 0.5 + VOXEL * np.arange(50)
    assert not_isolated(np.concatenate([cloth(), wire])).all()


def leaking_capture(folder: Path) -> Capture:
    """A ball before a wall, a patch of which is in the mask of one view."""
    views = ball_views(24)
    views[0][1].mask[5:12, 30:50] = 255
    return write_capture(folder, views)


def test_a_wall_that_leaks_into_one_mask_leaves_no_points(tmp_path: Path, monkeypatch) -> None:
    """Other views measure the wall at the same place, and only their masks tell that it is no object."""
    capture = leaking_capture(tmp_path)
    config = InitConfig(voxel_size=0.02)
    points = initialize(capture.frames, config).points
    assert np.linalg.norm(points.points_world, axis=1).max() < RADIUS * (1 + 1e-5)
    everything = np.float32(0), np.float32(np.inf)
    monkeypatch.setattr(view_points, "foreground_range", lambda *_: everything)
    again = initialize(capture.frames, config).points
    assert np.mean(np.linalg.norm(again.points_world, axis=1) > 2 * RADIUS) < 0.005
    assert len(again) > 0.98 * len(points)
    monkeypatch.setattr(depth_points, "not_seen_through", lambda places, *_: places[:, 0] < np.inf)
    unchecked = initialize(capture.frames, config).points
    assert np.sum(np.linalg.norm(unchecked.points_world, axis=1) > 2 * RADIUS) > 20


def test_a_view_without_its_mask_takes_no_points_away(tmp_path: Path) -> None:
    views = ball_views()
    for _, images in views[1:]:
        images.mask[:] = 0
    capture = write_capture(tmp_path, views)
    config = InitConfig(voxel_size=0.02)
    assert len(initialize(capture.frames, config).points) > 50


def test_what_another_object_hides_is_not_taken_for_empty() -> None:
    _, images = ball_views(1)[0]
    inside = images.mask > 0
    half = inside & (np.arange(80) < 40)
    hidden = inside & ~half
    seen_through = thinned_object_depth(images.depth, half) > images.depth
    assert (seen_through & inside).sum() > 200
    kept = thinned_object_depth(images.depth, half, hidden)
    np.testing.assert_array_equal(kept[inside], images.depth[inside])
    assert (kept > images.depth).sum() > 2000


def test_an_object_that_the_border_or_another_one_cuts_is_not_shown_whole() -> None:
    mask = np.zeros((40, 60), bool)
    mask[10:30, 20:40] = True
    assert shows_whole(mask) and not shows_whole(mask & False)
    for axis, shift in ((0, -10), (0, 10), (1, -20), (1, 20)):
        assert not shows_whole(np.roll(mask, shift, axis))
    assert not shows_whole(mask, np.roll(mask, 20, 1)) and shows_whole(mask, np.roll(mask, 23, 1))


@pytest.mark.parametrize("width", [640, 848, 1280, 1920])
def test_the_kept_pixels_lie_in_the_middle_of_those_that_they_stand_for(width: int) -> None:
    columns = np.broadcast_to(np.arange(width, dtype=np.float32), (width * 9 // 16, width))
    for kept in (thinned(columns), thinned(columns.T)):
        assert abs(kept.mean() - columns.mean()) <= 0.5
