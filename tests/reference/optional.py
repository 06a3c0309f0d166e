"""Libraries that need more than pip: tests skip, and say what to install, where they cannot be loaded."""

from typing import Any

import pytest

from digs_warp.device.libraries import MissingLibraryError, import_open3d


def open3d_or_skip() -> Any:
    try:
        return import_open3d()
    except MissingLibraryError as error:
        pytest.skip(str(error))
