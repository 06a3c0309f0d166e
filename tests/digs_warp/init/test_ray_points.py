"""Random points of a scene lie on the rays of pixels, in their colors."""

import numpy as np
import pytest

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.init.random_points import FARTHEST, NEAREST, random_points_on_rays
from reference.ball_capture import ball_views, write_capture


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> list[Frame]:
    capture = write_capture(tmp_path_factory.mktemp("ball"), ball_views(5))
    return [frame.without_layer(Layer.DEPTH).without_layer(Layer.MASK) for frame in capture.frames]


def test_every_view_gives_points_of_its_own_colors(frames: list[Frame]) -> None:
    count = 1003
    cloud = random_points_on_rays(frames, count)
    assert len(cloud) == count
    shares = np.diff(np.linspace(0, count, len(frames) + 1).astype(int))
    for frame, some in zip(frames, np.split(np.arange(count), np.cumsum(shares)[:-1]), strict=True):
        px, depth = frame.camera.project(cloud.points_world[some])
        columns, rows = np.floor(px).astype(int).T
        expected = frame.load_image()[rows, columns] / 255
        np.testing.assert_allclose(cloud.colors[some], expected, atol=1e-6)
        distance = np.linalg.norm(frame.camera.center_world)  # the cameras look at the origin
        assert (depth > 0.99 * NEAREST * distance).all()
        assert (depth < 1.01 * FARTHEST * distance).all()
        # They are spread over the whole image.
        assert np.ptp(columns) > 70 and np.ptp(rows) > 50
