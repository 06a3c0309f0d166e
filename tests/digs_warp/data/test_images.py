"""Image files: exact round trips, clear errors, and decoded once where they are read several times."""

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data import decoded as module
from digs_warp.data.decoded import decoded, decoded_once
from digs_warp.data.images import linear_from_srgb, read_image, srgb_from_linear, write_image
from reference.full_disk import largest_file


def random_pixels(dtype: str, shape: tuple[int, ...]) -> np.ndarray:
    rng = np.random.default_rng(0)
    if dtype == "float32":
        return rng.normal(size=shape).astype(np.float32)
    return rng.integers(0, np.iinfo(dtype).max + 1, shape).astype(dtype)


def test_what_is_written_is_read(tmp_path: Path) -> None:
    for dtype, shape in (
        *(("uint8", (1, 1)), ("uint8", (16, 33, 4)), ("uint16", (7, 5)), ("uint16", (7, 5, 3))),
        *(("float32", (7, 5)), ("float32", (16, 33, 4))),
    ):
        pixels = random_pixels(dtype, shape)
        path = tmp_path / "new_folder" / ("x.exr" if dtype == "float32" else "x.png")
        write_image(path, pixels)  # colors of transparent pixels survive
        found = read_image(path)
        assert found.dtype == pixels.dtype
        np.testing.assert_array_equal(found, pixels.reshape(*shape[:2], -1))


def test_exr_keeps_nan_infinity_and_tiny_values(tmp_path: Path) -> None:
    depth = np.array([[np.nan, np.inf, -np.inf], [0.0, 1e-38, 12345.678]], dtype=np.float32)
    write_image(tmp_path / "depth.exr", depth)
    np.testing.assert_array_equal(read_image(tmp_path / "depth.exr")[..., 0], depth)


def test_16_bit_files_carry_no_gamma(tmp_path: Path) -> None:
    """They hold depth; readers that honor the PNG's color space would bend it."""
    write_image(tmp_path / "depth.png", random_pixels("uint16", (6, 8)))
    data = (tmp_path / "depth.png").read_bytes()
    assert b"IHDR" in data and b"gAMA" not in data and b"sRGB" not in data


def test_files_that_are_truncated_missing_empty_or_foreign_are_named(tmp_path: Path) -> None:
    for name, share in (
        *(("x.png", 0.1), ("x.png", 0.9)),
        *(("x.exr", 0.1), ("x.exr", 0.5), ("x.exr", 0.9)),
    ):
        path = tmp_path / name
        write_image(path, random_pixels("uint8" if name == "x.png" else "float32", (64, 64, 3)))
        data = path.read_bytes()
        path.write_bytes(data[: int(share * len(data))])
        with pytest.raises(DigsError, match=rf"thing '.*{name}'"):
            read_image(path, "thing")
    (tmp_path / "empty.png").touch()
    (tmp_path / "text.png").write_text("not an image at all")
    for name, message in (
        *(("gone.png", "gone.png': no such file"), ("empty.png", "empty.png': the file is empty")),
        *(("text.png", "text.png': cannot be opened"), ("", "found a folder")),
    ):
        with pytest.raises(DigsError, match=message):
            read_image(tmp_path / name)


def test_the_same_pixels_give_the_same_bytes_at_any_time(tmp_path: Path) -> None:
    for path, dtype in ((tmp_path / "x.png", "uint8"), (tmp_path / "x.exr", "float32")):
        pixels = random_pixels(dtype, (9, 7, 3))
        write_image(path, pixels)
        before = path.read_bytes()
        time.sleep(1.1)  # dates in image files count in seconds
        write_image(path, pixels)
        assert path.read_bytes() == before


def test_an_image_that_does_not_fit_on_the_disk_leaves_the_old_one(tmp_path: Path) -> None:
    for name, dtype in (("x.png", "uint8"), ("x.png", "uint16"), ("x.exr", "float32")):
        path = tmp_path / name
        pixels = random_pixels(dtype, (40, 30, 3))
        write_image(path, pixels)
        before = path.read_bytes()
        for size in (0, 1, 100, len(before) // 2, len(before) - 20, len(before) - 1):
            with largest_file(size), pytest.raises(DigsError, match=rf"{name}': cannot be written"):
                write_image(path, pixels)
            assert path.read_bytes() == before
            assert list(tmp_path.iterdir()) == [path]
        path.unlink()


def test_srgb_curves_undo_each_other_and_meet_known_values() -> None:
    values = np.linspace(0, 1, 1001)
    np.testing.assert_allclose(linear_from_srgb(srgb_from_linear(values)), values, atol=1e-7)
    np.testing.assert_allclose(srgb_from_linear(np.array([0.0, 1.0])), [0, 1], atol=1e-12)
    # 18 % gray is 117.6 of 255 (IEC 61966-2-1).
    assert 255 * srgb_from_linear(np.array(0.18)) == pytest.approx(117.6, abs=0.05)


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


def test_no_more_is_kept_than_there_is_memory(path: Path, monkeypatch) -> None:
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
