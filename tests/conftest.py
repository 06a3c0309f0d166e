"""Fixtures shared by the whole suite."""

import logging
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from filelock import FileLock

from digs_warp.cli import TALKATIVE
from digs_warp.data.capture import Capture, read_capture
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.record.progress import show_progress
from digs_warp.train.config import Stop, TrainConfig
from reference.tiny_capture import write_tiny_capture

TINY_STEPS = 30

REPOSITORY = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def sample_data() -> Path:
    """The folder of other people's meshes, environments and recordings; skips where it is missing."""
    folder = Path(os.environ.get("DIGS_WARP_SAMPLE_DATA", REPOSITORY / "../shared/data")).resolve()
    if not folder.is_dir() or not any(folder.iterdir()):
        pytest.skip(f"no sample data in '{folder}' (set DIGS_WARP_SAMPLE_DATA)")
    return folder


MakeOnce = Callable[[str, Callable[[Path], object]], Path]


@pytest.fixture(scope="session")
def make_once(tmp_path_factory: pytest.TempPathFactory) -> MakeOnce:
    """Make a folder once for all processes of the suite: ``make_once("name", write_into)``.

    Whoever reads it changes nothing in it; a test that does copies it first.
    """
    root = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        root = root.parent  # that of the whole run

    def made(name: str, write: Callable[[Path], object]) -> Path:
        folder, done = root / "shared" / name, root / "shared" / f"{name}.done"
        folder.parent.mkdir(exist_ok=True)
        with FileLock(root / "shared" / f"{name}.lock"):
            if not done.exists():
                write(folder)
                done.touch()
        return folder

    return made


@pytest.fixture(scope="session")
def tiny_capture(make_once: MakeOnce) -> Capture:
    """The ball of `reference.tiny_capture`, 16 frames; read-only, see `make_once`."""
    return read_capture(make_once("tiny_capture", write_tiny_capture))


@pytest.fixture(scope="session")
def tiny_result(make_once: MakeOnce, tiny_capture: Capture) -> Path:
    """The folder of a short reconstruction of `tiny_capture`, with its course; read-only."""
    config = ReconstructConfig(
        train=TrainConfig(stop=Stop(iterations=TINY_STEPS), evaluate_at=(10,), keep_course=True)
    )
    return make_once("tiny_result", lambda folder: reconstruct(tiny_capture, config, folder))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what needs the sample data, so that it can be run by itself: -m sample_data."""
    for item in items:
        if "sample_data" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.sample_data)


# Of logs, as they are before a command line sets them for its process.
LEVELS = {name: logging.getLogger(name).level for name in (None, "digs_warp", *TALKATIVE)}


@pytest.fixture(autouse=True)
def command_line_is_over() -> Iterator[None]:
    """The command line shows bars and sets levels of logs for its process; fixtures and tests run it."""
    _forget_the_command_line()
    yield
    _forget_the_command_line()


def _forget_the_command_line() -> None:
    show_progress(False)
    for name, level in LEVELS.items():
        logging.getLogger(name).setLevel(level)


@pytest.fixture
def hangups_end_a_process() -> Iterator[None]:
    """Under nohup SIGHUP is ignored, also in every process that the suite starts; tests of it need it."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)
