"""The surround: reading panoramas, refusing bad ones, and the built-in room."""

import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.images import linear_from_srgb, write_image
from digs_warp.sim.scene.environment import (
    load_environment,
    panorama_directions,
)


def test_png_is_decoded_to_linear_light(tmp_path: Path) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (8, 16, 3), dtype=np.uint8)
    write_image(tmp_path / "sky.png", pixels)
    radiance = load_environment(tmp_path / "sky.png").radiance
    np.testing.assert_allclose(radiance, linear_from_srgb(pixels / 255.0), atol=1e-6)


def test_a_black_panorama_is_taken_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_image(tmp_path / "night.png", np.zeros((8, 16, 3), np.uint8))
    assert not load_environment(tmp_path / "night.png").radiance.any()
    assert "every pixel is black" in caplog.text


def test_exr_is_taken_as_it_is(tmp_path: Path) -> None:
    pixels = np.random.default_rng(0).uniform(0, 50, (8, 16, 3)).astype(np.float32)
    write_image(tmp_path / "sky.exr", pixels)
    np.testing.assert_array_equal(load_environment(tmp_path / "sky.exr").radiance, pixels)


def test_not_a_number_is_refused_with_its_count_and_a_command_that_mends_it(
    tmp_path: Path,
) -> None:
    pixels = np.ones((8, 16, 3), np.float32)
    pixels[2, 3], pixels[4, 5, 0] = np.nan, np.inf
    write_image(tmp_path / "sky.exr", pixels)
    with pytest.raises(DigsError, match=r"sky\.exr.*4 of 384 values are NaN") as refused:
        load_environment(tmp_path / "sky.exr")
    command = shlex.split(str(refused.value).partition("mend them with: ")[2])
    tool = Path(sys.executable).parent / command[0]
    subprocess.run([tool, *command[1:]], cwd=tmp_path, check=True)
    mended = load_environment(tmp_path / "mended.exr").radiance
    np.testing.assert_allclose(mended, 1.0, atol=1e-3)


def test_truncated_file_is_refused(tmp_path: Path, sample_data: Path) -> None:
    whole = (sample_data / "envs/forest_slope/forest_slope_1k.hdr").read_bytes()
    (tmp_path / "half.hdr").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "text.hdr").write_text("hello")
    for name in ("half.hdr", "text.hdr", "none.hdr"):
        with pytest.raises(DigsError, match=name.replace(".", r"\.")):
            load_environment(tmp_path / name)


def test_a_photo_is_no_panorama(tmp_path: Path) -> None:
    write_image(tmp_path / "photo.png", np.full((12, 16, 3), 9, np.uint8))
    with pytest.raises(DigsError, match="16x12 pixels, expected an equirectangular panorama"):
        load_environment(tmp_path / "photo.png")


def test_panorama_directions_are_unit_and_follow_the_convention() -> None:
    directions = panorama_directions(64, 32)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1.0, atol=1e-12)
    np.testing.assert_allclose(directions[0].mean(axis=0)[2], 1.0, atol=2e-3)
    np.testing.assert_allclose(directions[15:17, 31:33].mean(axis=(0, 1)), [1, 0, 0], atol=5e-3)
    # To the right of +x lies -y.
    assert directions[16, 40, 1] < 0
