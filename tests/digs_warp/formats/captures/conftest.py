"""What the tests of all formats start from."""

import pytest

from digs_warp.data.capture import Capture
from reference.labeled_capture import labeled_capture
from reference.recorded import small_capture


@pytest.fixture(scope="session")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return small_capture(tmp_path_factory.mktemp("small") / "capture")


@pytest.fixture(scope="session")
def pairs(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return labeled_capture(tmp_path_factory.mktemp("pairs") / "capture")
