"""The surround and the object that are built in, and panoramas of others: read, or refused."""

import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.images import linear_from_srgb, write_image
from digs_warp.sim.scene.builtin import builtin_scene, builtin_shape
from digs_warp.sim.scene.environment import (
    load_environment,
    panorama_directions,
)
from digs_warp.sim.scene.scene import Scene
from reference.mesh_files import assert_rests, check_arrays


@pytest.fixture(scope="module")
def scene() -> Scene:
    return builtin_scene()


def triangle_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = np.moveaxis(vertices[faces].astype(np.float64), 1, 0)
    return np.cross(b - a, c - a)


def test_arrays_fit_the_scene_type_and_cannot_be_changed(scene: Scene) -> None:
    for array in (scene.vertices, scene.faces, scene.materials[0].texture):
        assert array is not None
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    n, m = len(scene.vertices), len(scene.faces)
    assert 20_000 <= m <= 70_000
    check_arrays(scene)
    assert scene.faces.min() == 0
    assert scene.faces.max() == n - 1
    assert set(scene.face_materials) == set(range(len(scene.materials)))
    assert_rests(scene)
    low, high = scene.vertices.min(axis=0), scene.vertices.max(axis=0)
    np.testing.assert_allclose(high[2], 0.25, atol=1e-6)
    np.testing.assert_allclose(low + high, 0, atol=1e-6)


def test_normals_are_unit_and_agree_with_every_face(scene: Scene) -> None:
    np.testing.assert_allclose(np.linalg.norm(scene.normals, axis=1), 1, atol=1e-5)
    facing = triangle_normals(scene.vertices, scene.faces)
    area = np.linalg.norm(facing, axis=1)
    assert area.min() > 0
    cosine = np.einsum("ij,ij->i", facing, scene.normals[scene.faces].mean(axis=1)) / area
    assert (cosine > 0).mean() > 0.999
    assert np.quantile(cosine, 0.05) > 0.85  # less only where rims a millimetre wide turn round


def test_the_plain_shape_is_that_of_the_textured_object(scene: Scene) -> None:
    plain = builtin_shape()
    np.testing.assert_array_equal(plain.vertices, scene.vertices)
    np.testing.assert_array_equal(plain.faces, scene.faces)
    np.testing.assert_array_equal(plain.face_materials, scene.face_materials)
    check_arrays(plain)
    assert all(material.texture is None for material in plain.materials)


def test_a_black_panorama_is_taken_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_image(tmp_path / "night.png", np.zeros((8, 16, 3), np.uint8))
    assert not load_environment(tmp_path / "night.png").radiance.any()
    assert "every pixel is black" in caplog.text


def test_exr_is_taken_as_it_is_and_png_decoded_to_linear_light(tmp_path: Path) -> None:
    pixels = np.random.default_rng(0).uniform(0, 255, (8, 16, 3)).astype(np.float32)
    write_image(tmp_path / "sky.exr", pixels)
    np.testing.assert_array_equal(load_environment(tmp_path / "sky.exr").radiance, pixels)
    encoded = pixels.astype(np.uint8)
    write_image(tmp_path / "sky.png", encoded)
    radiance = load_environment(tmp_path / "sky.png").radiance
    np.testing.assert_allclose(radiance, linear_from_srgb(encoded / 255.0), atol=1e-6)


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
