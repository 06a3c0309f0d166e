"""The sparse points that came with a recording: those in view, or none at all."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud, read_points, write_points
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initialize
from digs_warp.init.recorded_points import FEWEST, recorded_points
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


def test_points_that_are_not_finite_are_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "points.ply"
    rows = "0 0 0 255 0 0\nnan 0 0 0 255 0\n0 0 inf 0 0 255\n"
    header = "".join(
        f"property {kind}\n"
        for kind in ("float x", "float y", "float z", "uchar red", "uchar green", "uchar blue")
    )
    path.write_text(f"ply\nformat ascii 1.0\nelement vertex 3\n{header}end_header\n{rows}")
    cloud = read_points(path)
    np.testing.assert_array_equal(cloud.points_world, [[0, 0, 0]])
    np.testing.assert_array_equal(cloud.colors, [[1, 0, 0]])
    assert "2 of 3 are not finite" in caplog.text
