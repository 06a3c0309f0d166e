"""What the tests of all exports start from."""

import pytest
from reference.recorded import small_capture

from digs_warp.capture import Capture


@pytest.fixture(scope="session")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return small_capture(tmp_path_factory.mktemp("exports") / "capture", soft_mask=True)
