"""Textures and material files beside a mesh: found by any spelling, or missed with a word."""

import json
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image
from trimesh.visual import TextureVisuals

from digs_warp.sim.scene.load import load_scene
from digs_warp.sim.scene.mesh.files_beside import locate
from digs_warp.sim.scene.mesh.read import mesh_files
from reference.mesh_files import OBJ, checker, textured_square


def write_obj(folder: Path, line: str) -> Path:
    """An OBJ whose material has this line in its MTL; its own color is a blue."""
    (folder / "s.obj").write_text(OBJ)
    (folder / "s.mtl").write_text(f"newmtl paint\nKd 0 0 1\n{line}\n")
    return folder / "s.obj"


@pytest.mark.parametrize(
    ("line", "file", "said"),
    [
        ("map_Kd Wood Grain.png", "Wood Grain.png", None),
        ("map_Kd tex/wood.png", "tex/wood.png", None),
        ("map_Kd Tex\\Wood.PNG", "tex/wood.png", "'Tex\\Wood.PNG' does not exist; using"),
        ("map_Kd C:\\me\\wood.png", "wood.png", "does not exist; using"),
        ("map_Kd /home/me/wood.png", "Wood.png", "does not exist; using"),
        ("map_Kd -s 2 2 1 -clamp on my wood.png", "my wood.png", "its options have no effect"),
    ],
)
def test_a_texture_is_found_by_the_names_of_other_systems(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, line: str, file: str, said: str | None
) -> None:
    path = write_obj(tmp_path, line)
    (tmp_path / file).parent.mkdir(exist_ok=True)
    checker().save(tmp_path / file)
    (material,) = load_scene(path, unit="m").materials
    np.testing.assert_array_equal(material.texture, np.asarray(checker()))
    if said is None:
        assert not caplog.records
    else:
        assert f"mesh 's.obj': texture '{line[7:]}'" in caplog.text and said in caplog.text


def test_an_exact_name_wins_over_one_in_other_case(tmp_path: Path) -> None:
    for name in ("WOOD.png", "Wood.png", "wood.png"):
        (tmp_path / name).write_text(name)
    assert locate(tmp_path, "Wood.png") == tmp_path / "Wood.png"
    assert locate(tmp_path, "wood.PNG") == tmp_path / "WOOD.png"
    assert locate(tmp_path, "none.png") is None
    assert locate(tmp_path, "wood.png/x") is None


def png_of(width: int, height: int) -> bytes:
    """A PNG that promises this size and holds no pixels."""
    header = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunk = struct.pack(">I", 13) + header + struct.pack(">I", zlib.crc32(header))
    return b"\x89PNG\r\n\x1a\n" + chunk + struct.pack(">I", 0) + b"IDAT"


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (None, "is missing"),
        (b"", "cannot be decoded"),
        (b"<html>not found</html>", "cannot be decoded"),
        ("truncated", "cannot be decoded"),
        (png_of(10_000, 8_000), "80,000,000 pixels, expected up to 67,108,864; scale the texture"),
        (png_of(40_000, 20_000), "scale the texture down"),
    ],
    ids=["missing", "empty", "no image", "truncated", "large", "huge"],
)
def test_an_obj_without_its_texture_says_so(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, data: Any, said: str
) -> None:
    path = write_obj(tmp_path, "map_Kd wood.png")
    if data == "truncated":
        checker(64).save(tmp_path / "wood.png")
        data = (tmp_path / "wood.png").read_bytes()[:90]
    if data is not None:
        (tmp_path / "wood.png").write_bytes(data)
    (material,) = load_scene(path, unit="m").materials
    assert material.texture is None
    np.testing.assert_array_equal(material.base_color, [0, 0, 1])
    (record,) = caplog.records
    text = record.getMessage()
    assert text.startswith("mesh 's.obj': texture 'wood.png'") and said in text
    assert text.endswith("drawn without it")


def test_a_map_of_opacity_cuts_holes(tmp_path: Path) -> None:
    ramp = np.tile(np.arange(16, dtype=np.uint8) * 16, (16, 1))
    Image.fromarray(ramp).save(tmp_path / "leaf.png")
    path = write_obj(tmp_path, "map_d leaf.png\nd 0.5")
    (material,) = load_scene(path, unit="m").materials
    assert material.opacity_texture is not None
    np.testing.assert_allclose(material.opacity_texture, ramp / 2, atol=0.5)
    assert material.alpha_cutoff > 0
    np.testing.assert_array_equal(material.base_color, [0, 0, 1])


@pytest.mark.parametrize(
    "lines", ["mtllib red.mtl\nmtllib green one.mtl", "mtllib red.mtl green.mtl"]
)
def test_an_obj_takes_all_its_material_files(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, lines: str
) -> None:
    (tmp_path / "red.mtl").write_text("newmtl red\nKd 1 0 0")
    green = "green one.mtl" if "one" in lines else "green.mtl"
    (tmp_path / green).write_text("newmtl green\nKd 0 1 0")
    corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
    faces = "usemtl red\nf 1 2 3\nusemtl green\nf 1 3 4\n"
    path = tmp_path / "s.obj"
    path.write_text(f"{lines}\n{corners}{faces}")
    colors = {each.name: each.base_color.tolist() for each in load_scene(path, unit="m").materials}
    assert colors == {"red": [1, 0, 0], "green": [0, 1, 0]}
    assert not caplog.records
    assert [each.name for each in mesh_files(path)] == ["s.obj", "red.mtl", green]


def test_a_material_file_is_found_by_a_name_in_latin_1(tmp_path: Path) -> None:
    (tmp_path / "s.obj").write_bytes(OBJ.replace("s.mtl", "b\xe4r.mtl").encode("latin-1"))
    (tmp_path / "b\xe4r.mtl").write_text("newmtl paint\nKd 0 1 0")
    (material,) = load_scene(tmp_path / "s.obj", unit="m").materials
    assert material.name == "paint"


def test_textures_of_ply_files_are_treated_the_same(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    corners = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 1, 2]], process=False)
    corners.visual = TextureVisuals(uv=[[0, 0], [1, 0], [1, 1]])
    text: Any = corners.export(file_type="ply", encoding="ascii")
    named = "format ascii 1.0\ncomment TextureFile Wood.png"
    header = text.decode().replace("format ascii 1.0", named)
    (tmp_path / "s.ply").write_text(header)
    checker().save(tmp_path / "wood.png")
    (material,) = load_scene(tmp_path / "s.ply", unit="m").materials
    assert material.texture is not None
    assert "'Wood.png' does not exist; using" in caplog.text
    (tmp_path / "wood.png").write_text("no image")
    (material,) = load_scene(tmp_path / "s.ply", unit="m").materials
    assert material.texture is None
    assert "mesh 's.ply': texture 'Wood.png' cannot be decoded" in caplog.text
    assert "Traceback" not in caplog.text
    more = "comment TextureFile Wood.png\ncomment TextureFile stone.png\n"
    (tmp_path / "s.ply").write_text(header.replace("comment TextureFile Wood.png\n", more))
    load_scene(tmp_path / "s.ply", unit="m")
    assert "mesh 's.ply': 2 textures, drawn with 'stone.png' alone" in caplog.text


def broken_image(tmp_path: Path, kind: str, data: bytes) -> Path:
    """A GLTF whose map of this kind is this file."""
    maps: dict[str, Any] = {kind: checker(), "baseColorTexture": checker(8)}
    square = textured_square(**maps)
    exported: Any = square.export(file_type="gltf")
    for name, content in exported.items():
        (tmp_path / name).write_bytes(content)
    path = tmp_path / "model.gltf"
    header = json.loads(path.read_text())
    material = header["materials"][0]
    entry = material[kind] if kind in material else material["pbrMetallicRoughness"][kind]
    image = header["images"][header["textures"][entry["index"]]["source"]]
    image.clear()
    image["uri"] = "map.png"
    path.write_text(json.dumps(header))
    (tmp_path / "map.png").write_bytes(data)
    return path


@pytest.mark.parametrize("kind", ["normalTexture", "metallicRoughnessTexture"])
def test_maps_of_a_gltf_that_are_damaged_are_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, kind: str
) -> None:
    load_scene(broken_image(tmp_path, kind, b"no image"))
    assert "'map.png' cannot be decoded" in caplog.text and "drawn without it" in caplog.text
