"""Textures, factors, colors, transparency and emission of every format."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose
from PIL import Image
from trimesh.visual import ColorVisuals

from digs_warp.data.images import linear_from_srgb, srgb_from_linear
from digs_warp.sim.scene.join import sampled_texture, srgb_vertex_colors
from digs_warp.sim.scene.load import load_scene
from digs_warp.sim.scene.scene import Material, Scene
from reference.mesh_files import (
    OBJ,
    check_scene,
    checker,
    edit_gltf,
    save,
    textured_square,
)


def test_pbr_factors_are_linear_and_multiplied_by_the_mean_of_their_texture(tmp_path: Path) -> None:
    image = Image.fromarray(np.full((8, 8, 3), (9, 102, 51), np.uint8))
    square = textured_square(
        baseColorFactor=[0.2, 0.4, 0.6, 1.0],
        roughnessFactor=0.5,
        metallicFactor=0.8,
        metallicRoughnessTexture=image,
    )
    material = load_scene(save(tmp_path / "s.glb", square)).materials[0]
    np.testing.assert_allclose(material.base_color, (0.2, 0.4, 0.6), atol=0.003)
    assert material.roughness == pytest.approx(0.5 * 102 / 255, abs=1e-6)
    assert material.metallic == pytest.approx(0.8 * 51 / 255, abs=1e-6)


@pytest.mark.parametrize(("suffix", "linear"), [(".glb", True), (".ply", False), (".obj", False)])
def test_vertex_colors_are_linear_in_gltf_and_srgb_elsewhere(
    tmp_path: Path, suffix: str, linear: bool
) -> None:
    mesh = trimesh.creation.icosphere(subdivisions=1)
    colors = np.tile(np.array((51, 102, 204, 255), np.uint8), (len(mesh.vertices), 1))
    mesh.visual = ColorVisuals(mesh, vertex_colors=colors)
    scene = load_scene(save(tmp_path / f"colored{suffix}", mesh))
    stored = np.array([51, 102, 204]) / 255
    expected = stored if linear else linear_from_srgb(stored)
    np.testing.assert_allclose(
        scene.vertex_colors, np.broadcast_to(expected, scene.vertices.shape), atol=1e-5
    )
    np.testing.assert_array_equal(scene.materials[0].base_color, 1)


def test_colors_of_faces_do_not_run_into_each_other(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    colors = np.random.default_rng(3).integers(0, 256, (12, 4)).astype(np.uint8)
    colors[:, 3] = 255
    box.visual = ColorVisuals(box, face_colors=colors)
    scene = load_scene(save(tmp_path / "box.ply", box))
    check_scene(scene)
    found = scene.vertex_colors[scene.faces]
    expected = np.repeat(linear_from_srgb(colors[:, None, :3] / 255), 3, axis=1)
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_mesh_without_any_color_is_plain_gray(tmp_path: Path) -> None:
    scene = load_scene(save(tmp_path / "ball.stl", trimesh.creation.icosphere(subdivisions=1)))
    (material,) = scene.materials
    assert material.texture is None
    assert np.ptp(material.base_color) == 0
    assert 0.2 < material.base_color[0] < 0.8
    np.testing.assert_array_equal(scene.vertex_colors, 1)


def test_an_obj_takes_its_texture_from_the_mtl_file(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "s.obj").write_text(OBJ)
    # A black diffuse color beside a texture is common, and must not blacken it.
    (tmp_path / "s.mtl").write_text("newmtl paint\nKd 0 0 0\nNs 200\nmap_Kd s.png\n")
    checker().save(tmp_path / "s.png")
    (material,) = load_scene(tmp_path / "s.obj").materials
    np.testing.assert_array_equal(material.texture, np.asarray(checker()))
    np.testing.assert_array_equal(material.base_color, 1)
    assert material.roughness == pytest.approx((2 / 202) ** 0.25)
    assert not caplog.records


def test_an_obj_color_is_srgb_and_missing_files_are_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "s.obj").write_text(OBJ)
    (tmp_path / "s.mtl").write_text("newmtl paint\nKd 0.2 0.4 0.8\nmap_Kd gone.png\nd 0.5\n")
    (material,) = load_scene(tmp_path / "s.obj").materials
    np.testing.assert_allclose(
        material.base_color, linear_from_srgb(np.array([51, 102, 204]) / 255), atol=1e-6
    )
    assert "'gone.png' is missing" in caplog.text
    assert material.opacity == 0.5

    (tmp_path / "s.mtl").unlink()
    caplog.clear()
    check_scene(load_scene(tmp_path / "s.obj"))
    assert "'s.mtl' is missing" in caplog.text


def test_a_blended_texture_gives_opacity_and_emission_its_color(tmp_path: Path) -> None:
    pixels = np.full((4, 4, 4), 100, np.uint8)
    clear = textured_square(
        baseColorTexture=Image.fromarray(pixels), alphaMode="BLEND", emissiveFactor=[1.0, 0.5, 0.0]
    )
    (material,) = load_scene(save(tmp_path / "s.glb", clear)).materials
    np.testing.assert_array_equal(material.texture, pixels[..., :3])
    np.testing.assert_array_equal(material.opacity_texture, pixels[..., 3])
    assert material.opacity == pytest.approx(100 / 255)
    assert material.emission == (1, 0.5, 0) and material.is_transparent


def test_a_mask_cuts_holes_with_hard_edges(tmp_path: Path) -> None:
    pixels = np.full((4, 4, 4), 200, np.uint8)
    pixels[:, :2, 3] = 120
    leaf = textured_square(
        baseColorTexture=Image.fromarray(pixels), alphaMode="MASK", alphaCutoff=0.6
    )
    (material,) = load_scene(save(tmp_path / "s.glb", leaf)).materials
    assert material.opacity_texture is not None
    np.testing.assert_array_equal(material.opacity_texture[0], [0, 0, 255, 255])
    assert material.alpha_cutoff == 0.5


def test_finish_and_normal_textures_carry_their_factors(tmp_path: Path) -> None:
    finish = np.zeros((2, 2, 3), np.uint8)
    finish[0], finish[1] = (0, 100, 200), (0, 200, 0)
    tilted = np.full((2, 2, 3), (150, 128, 253), np.uint8)
    square = textured_square(
        metallicRoughnessTexture=Image.fromarray(finish),
        roughnessFactor=0.5,
        metallicFactor=1.0,
        normalTexture=Image.fromarray(tilted),
    )
    (material,) = load_scene(save(tmp_path / "s.glb", square)).materials
    np.testing.assert_array_equal(material.finish_texture, [[[50, 200]] * 2, [[100, 0]] * 2])
    np.testing.assert_array_equal(material.normal_texture, tilted)


def test_what_shows_nothing_is_left_out(tmp_path: Path) -> None:
    """A flat normal map, an even finish, alpha of an opaque material, and an unused part of an atlas."""
    flat = Image.fromarray(np.full((2, 2, 3), (128, 127, 255), np.uint8))
    even = Image.fromarray(np.full((2, 2, 3), (0, 100, 200), np.uint8))
    square = textured_square(normalTexture=flat, metallicRoughnessTexture=even)
    (material,) = load_scene(save(tmp_path / "s.glb", square)).materials
    assert material.normal_texture is None and material.finish_texture is None
    pixels = np.zeros((8, 8, 4), np.uint8)
    pixels[4:, :4] = (0, 204, 0, 255)  # the bottom left quarter
    atlas = {"metallicRoughnessTexture": Image.fromarray(pixels[..., :3])}
    square = textured_square(0.5, baseColorTexture=Image.fromarray(pixels), **atlas)
    (material,) = load_scene(save(tmp_path / "s.glb", square)).materials
    assert material.roughness == pytest.approx(204 / 255, abs=1e-6)
    assert material.opacity == 1 and material.opacity_texture is None


def test_extensions_are_read_or_said_to_be_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Glass, strength of emission and scale of the normal map; not varnish, cloth and bodies of glass."""
    tilted = np.full((2, 2, 3), (148, 108, 250), np.uint8)
    square = textured_square(
        emissiveFactor=[0.5, 0.5, 0.0],
        normalTexture=Image.fromarray(tilted),
        baseColorTexture=Image.fromarray(np.full((2, 2, 3), 51, np.uint8)),
    )
    path = save(tmp_path / "s.glb", square)

    def add_extensions(header: dict[str, Any]) -> None:
        material = header["materials"][0]
        material["normalTexture"]["scale"] = 0.5
        color_index = material["pbrMetallicRoughness"]["baseColorTexture"]["index"]
        material["extensions"] = {
            "KHR_materials_transmission": {
                "transmissionFactor": 0.8,
                "transmissionTexture": {"index": color_index},
            },
            "KHR_materials_emissive_strength": {"emissiveStrength": 3.0},
            "KHR_materials_ior": {"ior": 1.33},
            "KHR_materials_specular": {"specularFactor": 0.5},
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.5},
            "KHR_materials_sheen": {"sheenColorFactor": [0.5, 0.25, 1.0]},
            "KHR_materials_volume": {"thicknessFactor": 0.1},
        }

    edit_gltf(path, add_extensions)
    (found,) = load_scene(path).materials
    assert found.emission == (1.5, 1.5, 0)
    assert found.transmission == pytest.approx(0.8 * 51 / 255, abs=2e-3)
    assert found.normal_texture is not None
    np.testing.assert_array_equal(found.normal_texture[0, 0], [138, 118, 250])
    assert found.reflectance == pytest.approx(0.5 * (0.33 / 2.33) ** 2)
    for said in ("without its varnish", "without its sheen", "as a thin wall"):
        assert f"drawn {said}" in caplog.text


def slow_sample(texture: np.ndarray, u: float, v: float) -> np.ndarray:
    """Bilinear by the definition: every texel weighs by its distance, the image repeated three times."""
    height, width = texture.shape[:2]
    u, v = u % 1.0, v % 1.0
    total = np.zeros(3)
    for row in range(-height, 2 * height):
        for column in range(-width, 2 * width):
            x = abs(u * width - (column + 0.5))
            y = abs((1 - v) * height - (row + 0.5))
            if x < 1 and y < 1:
                texel = texture[row % height, column % width] / 255.0
                total += (1 - x) * (1 - y) * linear_from_srgb(texel)
    return total


def test_textures_are_sampled_between_texels_and_repeat():
    rng = np.random.default_rng(0)
    texture = rng.integers(0, 256, (4, 6, 3), dtype=np.uint8)
    uvs = np.vstack([rng.uniform(-2, 3, (50, 2)), [[0, 0], [1, 1], [0.999, 0.001], [-1, 2]]])
    expected = [slow_sample(texture, u, v) for u, v in uvs]
    assert_allclose(sampled_texture(texture, uvs), expected, atol=1e-12)


def test_factor_texture_and_vertex_color_multiply_for_each_material():
    texture = np.full((1, 1, 3), 128, dtype=np.uint8)
    materials = (
        Material("textured", np.array([1.0, 0.5, 0.25]), texture),
        Material("plain", np.array([0.1, 0.2, 0.3])),
    )
    vertex_colors = np.ones((7, 3), np.float32)
    vertex_colors[0] = 0.5
    scene = Scene(
        vertices=np.zeros((7, 3), np.float32),
        faces=np.array([[0, 1, 2], [3, 4, 5]], np.int32),
        face_materials=np.array([0, 1], np.int32),
        normals=np.zeros((7, 3), np.float32),
        uvs=np.zeros((7, 2), np.float32),
        vertex_colors=vertex_colors,
        materials=materials,
    )
    gray = linear_from_srgb(np.array(128 / 255))
    linear = np.array([[1.0, 0.5, 0.25]]) * gray
    expected = np.vstack([0.5 * linear, linear, linear, [[0.1, 0.2, 0.3]] * 3])
    found = srgb_vertex_colors(scene)
    assert found.dtype == np.float32
    assert_allclose(found[:6], srgb_from_linear(expected), atol=1e-6)
    assert_allclose(found[6], 1.0)  # in no face
