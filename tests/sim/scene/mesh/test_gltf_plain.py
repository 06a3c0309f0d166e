"""Parts of glTF that trimesh leaves out or misreads: read as the standard says."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import MeshError
from digs_warp.sim.scene.load import load_scene
from digs_warp.sim.scene.scene import Scene
from reference.gltf_builder import CORNERS, UVS, GltfBuilder
from reference.mesh_files import check_scene, checker

UNLIT = {"extensions": {"KHR_materials_unlit": {}}}
SHOWN_UVS = np.stack([UVS[:, 0], 1 - UVS[:, 1]], axis=1)  # of a scene: v points up


def load(builder: GltfBuilder, folder: Path) -> Scene:
    scene = load_scene(builder.save(folder / "m.glb"), up="y")
    check_scene(scene)
    return scene


def uvs_by_corner(scene: Scene) -> np.ndarray:
    """The texture coordinates in the order of `CORNERS`; the scene has z up."""
    low = scene.vertices.min(axis=0)
    at = (scene.vertices - low)[:, [0, 2]]
    order = [int(np.abs(at - corner[:2]).sum(axis=1).argmin()) for corner in CORNERS]
    return scene.uvs[order]


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_texture_coordinates_of_integers_are_shares_of_their_range(
    tmp_path: Path, kind: Any
) -> None:
    builder = GltfBuilder()
    whole = UVS * np.iinfo(kind).max
    builder.primitive["attributes"]["TEXCOORD_0"] = builder.add(whole.astype(kind), True)
    np.testing.assert_allclose(uvs_by_corner(load(builder, tmp_path)), SHOWN_UVS, atol=1e-6)


def test_positions_of_integers_are_shares_of_their_range(tmp_path: Path) -> None:
    builder = GltfBuilder()
    steps = np.rint(CORNERS / 0.3 * 32767).astype(np.int16)
    builder.primitive["attributes"]["POSITION"] = builder.add(steps, True)
    builder.header["nodes"][0]["scale"] = [0.3, 0.3, 0.3]
    builder.header["extensionsRequired"] = ["KHR_mesh_quantization"]
    np.testing.assert_allclose(load(builder, tmp_path).size, [0.3, 0, 0.2], atol=1e-4)


def test_a_sparse_accessor_replaces_what_it_names(tmp_path: Path) -> None:
    builder = GltfBuilder()
    position = builder.header["accessors"][builder.primitive["attributes"]["POSITION"]]
    position["sparse"] = {
        "count": 2,
        "indices": {
            "bufferView": builder.view(np.array([1, 2], "<u2").tobytes()),
            "componentType": 5123,
        },
        "values": {"bufferView": builder.view((CORNERS[1:3] * (2, 1, 1)).astype("<f4").tobytes())},
    }
    np.testing.assert_allclose(load(builder, tmp_path).size, [0.6, 0, 0.2], atol=1e-6)


@pytest.mark.parametrize("indexed", [True, False])
def test_a_fan_is_its_triangles(tmp_path: Path, indexed: bool) -> None:
    builder = GltfBuilder()
    builder.primitive["mode"] = 6
    del builder.primitive["indices"]
    if indexed:
        builder.primitive["indices"] = builder.add(np.array([3, 0, 1, 2], np.uint8))
    scene = load(builder, tmp_path)
    assert len(scene.faces) == 2
    np.testing.assert_allclose(scene.size, [0.3, 0, 0.2], atol=1e-6)


def test_a_texture_lies_where_its_transform_says(tmp_path: Path) -> None:
    """The example of the extension: the lower left quarter of the image, turned by 90 degrees."""
    builder = GltfBuilder()
    transform = {"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5]}
    builder.material["pbrMetallicRoughness"]["baseColorTexture"] = {
        "index": builder.add_texture(checker()),
        "extensions": {"KHR_texture_transform": transform},
    }
    expected = np.array([[0.5, 0], [0.5, 0.5], [0, 0.5], [0, 0]])  # v points up
    np.testing.assert_allclose(uvs_by_corner(load(builder, tmp_path)), expected, atol=1e-6)


def test_maps_in_different_places_are_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    builder = GltfBuilder()
    texture = builder.add_texture(checker())
    builder.material["pbrMetallicRoughness"]["baseColorTexture"] = {"index": texture}
    builder.material["emissiveTexture"] = {"index": texture, "texCoord": 1}
    attributes = builder.primitive["attributes"]
    attributes["TEXCOORD_1"] = builder.add(np.zeros_like(UVS))
    np.testing.assert_allclose(uvs_by_corner(load(builder, tmp_path)), SHOWN_UVS, atol=1e-6)
    assert "material '0': its maps lie in different places" in caplog.text


def test_parts_keep_their_own_materials(tmp_path: Path) -> None:
    """Two materials of one name, one with a texture and one without light, and a part without material."""
    builder = GltfBuilder()
    glass = {"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}}}
    builder.header["materials"] = [{"name": "paint", **glass}, {"name": "paint", **UNLIT}]
    texture = {"baseColorTexture": {"index": builder.add_texture(checker())}}
    builder.header["materials"][0]["pbrMetallicRoughness"] = texture
    for height, more in ((0.5, {"material": 1}), (1.0, {})):
        above = builder.add((CORNERS + (0, height, 0)).astype(np.float32))
        part = {"attributes": {"POSITION": above}, "indices": 2, **more}
        builder.header["meshes"][0]["primitives"].append(part)
    scene = load(builder, tmp_path)
    materials = scene.materials
    heights = [scene.vertices[scene.faces[scene.face_materials == k], 2].mean() for k in range(3)]
    assert np.diff(heights) == pytest.approx([0.5, 0.5])
    assert [material.transmission for material in materials] == [1.0, 0.0, 0.0]
    assert [material.texture is not None for material in materials] == [True, False, False]
    assert len({material.name for material in materials}) == 3
    assert materials[1].metallic == 0  # the default of glTF is 1


def test_a_webp_map_of_an_extension_is_read(tmp_path: Path) -> None:
    builder = GltfBuilder()
    texture = builder.add_texture(checker(), "WEBP")
    builder.header["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 0}}}]
    builder.material["extensions"] = {
        "KHR_materials_transmission": {
            "transmissionFactor": 1.0,
            "transmissionTexture": {"index": texture},
        }
    }
    (material,) = load(builder, tmp_path).materials
    assert material.transmission_texture is not None
    assert material.transmission_texture.mean() == pytest.approx(255 / 4, abs=5)  # the red quarter


def test_a_mesh_with_a_skeleton_stands_where_its_joints_hold_it(tmp_path: Path) -> None:
    """Two joints share the work; the node of the mesh itself is a hundredth in size and means nothing."""
    builder = GltfBuilder()
    attributes = builder.primitive["attributes"]
    attributes["JOINTS_0"] = builder.add(np.tile(np.array([0, 1, 0, 0], np.uint8), (4, 1)))
    share = np.array([[255, 0], [255, 0], [0, 255], [0, 255]])  # the upper edge follows the second
    weights = np.concatenate([share, np.zeros((4, 2))], axis=1).astype(np.uint8)
    attributes["WEIGHTS_0"] = builder.add(weights, True)
    inverse = np.tile(np.diag([100.0, 100.0, 100.0, 1.0]).astype(np.float32), (2, 1, 1))
    builder.header["nodes"] = [
        {"scale": [0.01, 0.01, 0.01], "children": [1, 2, 3]},
        {"mesh": 0, "skin": 0},
        {"name": "still"},
        {"name": "up", "translation": [0, 10, 0]},  # 0.1 m in the world
    ]
    builder.header["skins"] = [{"joints": [2, 3], "inverseBindMatrices": builder.add(inverse)}]
    np.testing.assert_allclose(load(builder, tmp_path).size, [0.3, 0, 0.3], atol=1e-5)


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ({"extensionsRequired": ["EXT_other"]}, "it requires EXT_other, which is not read"),
        ({"nodes": [{"mesh": 0, "weights": [0.5]}]}, "morph targets are not read"),
    ],
)
def test_what_is_not_read_is_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, header: dict[str, Any], said: str
) -> None:
    builder = GltfBuilder()
    builder.header |= header
    load(builder, tmp_path)
    assert said in caplog.text


def compress(builder: GltfBuilder, name: str, has_plain: bool) -> None:
    """Name an extension that is not read, with or without plain data beside it."""
    builder.header["extensionsUsed"] = [name]
    if name == "EXT_mesh_gpu_instancing":
        builder.header["nodes"][0]["extensions"] = {name: {"attributes": {}}}
        builder.header["extensionsRequired"] = [] if has_plain else [name]
    elif "texture" in name.lower():
        number = builder.add_texture(checker())
        builder.header["images"].append({"uri": "not-copied.ktx2", "mimeType": "image/ktx2"})
        texture = builder.header["textures"][number]
        texture["extensions"] = {name: {"source": 1}}
        builder.material["pbrMetallicRoughness"]["baseColorTexture"] = {"index": number}
        if not has_plain:
            del texture["source"]
    elif "draco" in name:
        builder.primitive["extensions"] = {name: {"bufferView": 0, "attributes": {"POSITION": 0}}}
        if not has_plain:
            del builder.header["accessors"][0]["bufferView"]
    else:
        view = builder.header["bufferViews"][0]
        view["extensions"] = {name: {"buffer": 0, "byteLength": 4, "byteStride": 12, "count": 4}}
        if not has_plain:
            absent = {"byteLength": 48, "extensions": {name: {"fallback": True}}}
            builder.header["buffers"], view["buffer"] = [{}, absent], 1


@pytest.mark.parametrize("has_plain", [True, False])
@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("KHR_texture_basisu", "as PNG or JPEG"),
        ("EXT_texture_avif", "as PNG or JPEG"),
        ("KHR_draco_mesh_compression", "without Draco"),
        ("EXT_meshopt_compression", "without meshopt"),
        ("KHR_meshopt_compression", "without meshopt"),
        ("EXT_mesh_gpu_instancing", "without GPU instancing"),
    ],
)
def test_what_is_not_read_is_refused_unless_plain_data_is_beside_it(
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    name: str,
    remedy: str,
    has_plain: bool,
) -> None:
    builder = GltfBuilder()
    compress(builder, name, has_plain)
    if not has_plain:
        with pytest.raises(MeshError, match=f"{name}.*{remedy}"):
            load(builder, tmp_path)
        return
    scene = load(builder, tmp_path)
    np.testing.assert_allclose(scene.size, [0.3, 0, 0.2], atol=1e-6)
    assert (scene.materials[0].texture is not None) == ("texture" in name.lower())
    assert ("each drawn once" in caplog.text) == ("instancing" in name)


def test_splats_are_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    builder = GltfBuilder()
    name = "KHR_gaussian_splatting"
    attributes = {"POSITION": 0, f"{name}:SCALE": 0, f"{name}:ROTATION": 0}
    splats = {"attributes": attributes, "mode": 0, "extensions": {name: {"kernel": "ellipse"}}}
    builder.header["meshes"][0]["primitives"].append(splats)
    builder.header["extensionsUsed"] = [name]
    assert len(load(builder, tmp_path).faces) == 2
    assert "Gaussian splats are not read" in caplog.text
    builder.header["meshes"][0]["primitives"] = [splats]
    with pytest.raises(MeshError, match=r"Gaussian splats .*digs-warp view"):
        load(builder, tmp_path)
