"""Frames that are decoded while the program starts: the same pixels, each once, errors where they belong."""

import sys
from collections.abc import Iterator
from pathlib import Path
from threading import Event
from threading import enumerate as running_threads

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data import decoded as kept
from digs_warp.data import frame as module
from digs_warp.data.capture import Capture
from digs_warp.data.decoded import decoded_once, room_left
from digs_warp.data.images import read_image
from digs_warp.data.layers import Layer
from digs_warp.data.read_ahead import TURN, reading_ahead
from reference.ball_capture import ball_views, write_capture


@pytest.fixture
def capture(tmp_path: Path) -> Capture:
    return write_capture(tmp_path, ball_views(4))


@pytest.fixture
def files(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Path]]:
    """The files that frames decode."""
    found: list[Path] = []

    def read(path: Path, what: str) -> np.ndarray:
        found.append(path)
        return read_image(path, what)

    monkeypatch.setattr(module, "read_image", read)
    yield found


def wait_for_the_reader() -> None:
    for thread in running_threads():
        if thread.name == "read ahead":
            thread.join(30)


def test_each_file_is_decoded_once_to_the_same_pixels(capture: Capture, files: list[Path]) -> None:
    before = [
        (frame.load_image(), frame.load_mask(), frame.load_depth()) for frame in capture.frames
    ]
    files.clear()
    with reading_ahead(capture.frames):
        with decoded_once():
            for frame, (image, mask, depth) in zip(capture.frames, before, strict=True):
                np.testing.assert_array_equal(frame.load_image(), image)
                np.testing.assert_array_equal(frame.load_mask(), mask)
                np.testing.assert_array_equal(frame.load_depth(), depth)
            wait_for_the_reader()
        assert room_left() == 0, "the training has the memory for itself"
    assert len(files) == len(set(files)) == 3 * len(capture)


def test_a_broken_file_is_an_error_of_who_needs_it(capture: Capture, files: list[Path]) -> None:
    broken = capture.frames[1].path(Layer.DEPTH)
    broken.write_bytes(b"no image")
    with reading_ahead(capture.frames):
        wait_for_the_reader()
        assert capture.frames[3].path(Layer.MASK) in files
        with pytest.raises(DigsError, match=broken.name):
            capture.frames[1].load_depth()


def test_reading_ahead_ends_where_the_memory_does(
    capture: Capture, files: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept, "MEMORY", 2 * capture.frames[0].load_image().nbytes)
    files.clear()
    with reading_ahead(capture.frames):
        wait_for_the_reader()
    assert 0 < len(files) < 3 * len(capture)


def test_nothing_goes_on_behind_the_block(capture: Capture) -> None:
    with pytest.raises(DigsError, match="wrong flag"), reading_ahead(capture.frames * 50):
        raise DigsError("wrong flag")
    assert "read ahead" not in [thread.name for thread in running_threads()]
    assert room_left() == 0


def test_turns_are_the_usual_ones_after_two_readers_that_overlap(
    capture: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = sys.getswitchinterval()
    others = write_capture(capture.folder / "others", ball_views(1))
    within, go_on = Event(), Event()

    def read(path: Path, what: str) -> np.ndarray:
        if "others" in path.parts:
            within.set()
            assert go_on.wait(30)
        assert within.wait(30)
        raise DigsError("broken")

    monkeypatch.setattr(module, "read_image", read)
    first = reading_ahead(others.frames)
    with reading_ahead(capture.frames):
        first.__enter__()
        assert within.wait(30)
    assert sys.getswitchinterval() == pytest.approx(TURN), "one of them is still reading"
    go_on.set()
    first.__exit__(None, None, None)
    assert sys.getswitchinterval() == usual
