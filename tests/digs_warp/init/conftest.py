"""The balls that most tests of the initialization look at; do not change their files."""

import pytest

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from reference.ball_capture import ball_views, write_capture


@pytest.fixture(scope="session")
def ball_ring(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """Twelve views of a ball in front of a wall."""
    return write_capture(tmp_path_factory.mktemp("ball"), ball_views(12))


@pytest.fixture(scope="session")
def ball_frames(tmp_path_factory: pytest.TempPathFactory) -> tuple[Frame, ...]:
    """Eight of them."""
    return write_capture(tmp_path_factory.mktemp("eight"), ball_views()).frames
