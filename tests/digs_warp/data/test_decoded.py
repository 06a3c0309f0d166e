"""Files that are decoded once while a reconstruction reads them several times."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from digs_warp.data import decoded as module
from digs_warp.data.decoded import decoded, decoded_once
from digs_warp.data.images import read_image, write_image

IMAGE = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_image(tmp_path / "image.png", IMAGE)
    return tmp_path / "image.png"


def counting() -> tuple[Callable[[Path], np.ndarray], list[Path]]:
    """Return a function that reads an image, and the files that it has read."""
    files: list[Path] = []

    def read(path: Path) -> np.ndarray:
        files.append(path)
        return read_image(path)

    return read, files


def test_a_file_is_decoded_once_and_each_caller_has_its_own_pixels(path: Path) -> None:
    read, files = counting()
    with decoded_once():
        for _ in range(3):
            with decoded_once():
                pass  # drops nothing of the block around it
            pixels = decoded(path, read)
            np.testing.assert_array_equal(pixels, IMAGE)
            pixels[:] = 0
    assert files == [path]


def test_a_file_that_changed_is_read_again(path: Path) -> None:
    with decoded_once():
        path.write_bytes(b"before")
        decoded(path, lambda path: np.fromfile(path, np.uint8))
        path.write_bytes(b"after!")
        os.utime(path, ns=(0, 0))  # as if it were written at another time
        assert decoded(path, lambda path: np.fromfile(path, np.uint8)).tobytes() == b"after!"


def test_no_more_is_kept_than_there_is_memory(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MEMORY", IMAGE.nbytes)
    other = path.with_name("other.png")
    write_image(other, IMAGE)
    read, files = counting()
    with decoded_once():
        for each in (path, other, path, other):
            decoded(each, read)
    assert files == [path, other, other]


def test_threads_wait_for_the_one_that_decodes_the_file(path: Path) -> None:
    read, files = counting()
    begun, go_on = Event(), Event()

    def slowly(path: Path) -> np.ndarray:
        begun.set()
        assert go_on.wait(120)
        return read(path)

    with decoded_once(), ThreadPoolExecutor(2) as pool:
        first = pool.submit(decoded, path, slowly)
        assert begun.wait(120)
        second = pool.submit(decoded, path, read)
        go_on.set()
        np.testing.assert_array_equal(first.result(), second.result())
    assert files == [path]
