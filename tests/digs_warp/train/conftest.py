"""The recording that the tests of the training share."""

import pytest

from digs_warp.data.capture import Capture
from reference.tiny_capture import write_tiny_capture


@pytest.fixture(scope="module")
def capture(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """Photographs of a ball, as many as the module says in ``FRAMES``."""
    folder = tmp_path_factory.mktemp("tiny") / "capture"
    return write_tiny_capture(folder, frames=getattr(request.module, "FRAMES", 8))
