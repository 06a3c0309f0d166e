"""The sparse points that came with a recording: those in view, or none at all."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud, write_points
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initialize
from digs_warp.init.sparse_points import FEWEST, recorded_points
from reference.ball_capture import ball_views, write_capture

Sparse = Callable[[np.ndarray], Capture]


@pytest.fixture
def with_points(tmp_path: Path) -> Sparse:
    """Return a capture without depth that has the given points."""
    from dataclasses import replace

    capture = write_capture(tmp_path / "capture", ball_views(4))
    frames = tuple(frame.without_layer(Layer.DEPTH) for frame in capture.frames)

    def make(points: np.ndarray) -> Capture:
        write_points(tmp_path / "points.ply", PointCloud(points, np.full(points.shape, 0.5)))
        return replace(capture, frames=frames, points=tmp_path / "points.ply")

    return make


def near_the_middle(count: int) -> np.ndarray:
    return np.random.default_rng(0).uniform(-0.1, 0.1, (count, 3))


def test_points_that_no_view_shows_are_left_out(with_points: Sparse) -> None:
    above = np.array([[0.0, 0.0, 50.0], [0.0, 0.0, -50.0]])
    capture = with_points(np.concatenate([near_the_middle(300), above]))
    cameras = [frame.camera for frame in capture.frames]
    found = recorded_points(capture, cameras)
    assert found is not None and len(found) == 300
    start = initialize(capture.frames, InitConfig(strategy="default"), recorded=found)
    assert start.sources == {"recorded": 300}
    assert start.because == "the sparse points of the recording, which has no depth"


def test_too_few_points_are_as_good_as_none(
    with_points: Sparse, caplog: pytest.LogCaptureFixture
) -> None:
    capture = with_points(near_the_middle(FEWEST - 1))
    assert recorded_points(capture, [frame.camera for frame in capture.frames]) is None
    assert "too few to start from" in caplog.text
