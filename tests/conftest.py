"""Fixtures shared by the whole suite."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from digs_warp.record.progress import show_progress

REPOSITORY = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def sample_data() -> Path:
    """The folder of other people's meshes, environments and recordings; skips where it is missing."""
    folder = Path(os.environ.get("DIGS_WARP_SAMPLE_DATA", REPOSITORY / "../shared/data")).resolve()
    if not folder.is_dir():
        pytest.skip(f"no sample data in '{folder}' (set DIGS_WARP_SAMPLE_DATA)")
    return folder


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what needs the sample data, so that it can be run by itself: -m sample_data."""
    for item in items:
        if "sample_data" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.sample_data)


@pytest.fixture(autouse=True)
def bars_off_again() -> Iterator[None]:
    """The command line turns progress bars on for its process; a test that runs it must not."""
    yield
    show_progress(False)


@pytest.fixture
def hangups_end_a_process() -> Iterator[None]:
    """Under nohup SIGHUP is ignored, also in every process that the suite starts; tests of it need it."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)
