"""Points alone in the air are dropped; surfaces, however thin or coarse, are not."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.init import depth_points, view_points
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initialize
from digs_warp.init.view_points import thinned_object_depth
from digs_warp.init.visibility import not_isolated
from reference.ball_capture import RADIUS, ball_views, write_capture

VOXEL = 0.004


def plate(side: float = 0.2, spacing: float = VOXEL) -> np.ndarray:
    """A square of points, about as voxels leave them."""
    steps = np.arange(0, side, spacing)
    grid = np.stack(np.meshgrid(steps, steps, [0.0]), axis=-1).reshape(-1, 3)
    return grid + np.random.default_rng(0).uniform(-0.3, 0.3, grid.shape) * spacing


def test_points_away_from_everything_are_dropped() -> None:
    strays = np.array([[2.0, 0, 0], [0, 0, -1.5], [0.1, 0.1, 0.2], [3, 3, 3], [3, 3, 3.01]])
    points = np.concatenate([plate(), strays])
    np.testing.assert_array_equal(not_isolated(points), np.arange(len(points)) < len(plate()))
    wire = np.zeros((50, 3))  # one voxel thick
    wire[:, 2] = 0.5 + VOXEL * np.arange(50)
    assert not_isolated(np.concatenate([plate(), wire])).all()


def leaking_capture(folder: Path) -> Capture:
    """A ball before a wall, a patch of which is in the mask of one view."""
    views = ball_views(24)
    views[0][1].mask[5:12, 30:50] = 255
    return write_capture(folder, views)


def test_a_wall_that_leaks_into_one_mask_leaves_no_points(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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
