"""The colors in which photographs see points: the kernel against plain NumPy."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.layers import Layer
from digs_warp.init.seen_colors import colors_in
from reference.ball_capture import RADIUS, ball_views, write_capture
from reference.seen_colors_twin import colors_seen


def points_around(count: int) -> np.ndarray:
    """On the ball, in front of it, inside it, behind the cameras, and in no image."""
    rng = np.random.default_rng(2)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return directions * RADIUS * rng.uniform(0.5, 9.0, (count, 1)) ** rng.integers(0, 2, (count, 1))


@pytest.mark.parametrize("without", [(), (Layer.MASK,), (Layer.DEPTH,), (Layer.MASK, Layer.DEPTH)])
def test_colors_are_those_of_the_twin(tmp_path: Path, without: tuple[Layer, ...]) -> None:
    views = ball_views(3)
    for _, images in views:
        images.depth[np.random.default_rng(1).random(images.depth.shape) < 0.1] = np.nan
    points = points_around(600)
    for frame in write_capture(tmp_path, views).frames:
        for layer in without:
            frame = frame.without_layer(layer)
        found, expected = colors_in(points, frame), colors_seen(points, frame)
        np.testing.assert_allclose(found, expected, rtol=1e-14)
        assert 0 < np.isfinite(found[:, 0]).sum() < len(points)
