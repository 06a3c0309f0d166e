"""The ball that most tests of the initialization look at."""

import pytest

from digs_warp.data.capture import Capture
from reference.ball_capture import ball_views, write_capture


@pytest.fixture(scope="session")
def ball_ring(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """Twelve views of a ball in front of a wall; do not change its files."""
    return write_capture(tmp_path_factory.mktemp("ball"), ball_views(12))
