"""Bad faces, damaged and missing files, textures by any spelling: read, dropped with a word, or refused."""

import json
import os
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image
from trimesh.visual import TextureVisuals

from digs_warp.checks import MeshError
from digs_warp.sim.scene.load import load_scene
from digs_warp.sim.scene.mesh.files_beside import locate
from digs_warp.sim.scene.mesh.read import mesh_files
from reference.mesh_files import (
    OBJ,
    check_scene,
    checker,
    lopsided,
    save,
    textured_square,
)


@pytest.mark.filterwarnings("error")
def test_bad_faces_are_dropped_and_counted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "bad.obj"
    vertices = ("0 0 0", "1 0 0", "1 1 0", "0 1 .5", ".5 0 0", "9 nan 9", "7 7 inf")
    faces = ("1 2 3", "1 3 4", "1 1 2", "1 5 2", "1 2 6", "7 3 2")
    path.write_text("".join([f"v {v}\n" for v in vertices] + [f"f {f}\n" for f in faces]))
    scene = load_scene(path, up="z")
    check_scene(scene)
    assert len(scene.faces) == 2
    # Vertices of dropped faces do not count for the size, either: the longest edge is 1.
    assert scene.size.max() == pytest.approx(1.0)
    assert "dropped 4 of 6 faces (2 with vertices that are not finite, 2 without area)" in (
        caplog.text
    )


def test_a_thin_sheet_is_not_taken_for_a_face_without_area(tmp_path: Path) -> None:
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1e-5, 0]], [[0, 1, 2]], process=False)
    assert len(load_scene(save(tmp_path / "sheet.stl", sheet)).faces) == 1


# ---- errors ----


def expect_error(path: Path, *fragments: str, **settings: Any) -> None:
    with pytest.raises(MeshError) as caught:
        load_scene(path, **settings)
    for fragment in (*fragments, str(path)):
        assert fragment in str(caught.value)


def test_a_missing_or_empty_file_or_a_folder_is_named(tmp_path: Path) -> None:
    expect_error(tmp_path / "no.glb", "no such file")
    (tmp_path / "empty.glb").touch()
    expect_error(tmp_path / "empty.glb", "0 bytes")
    (tmp_path / "folder.glb").mkdir()
    expect_error(tmp_path / "folder.glb", "found a folder")


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ({}, "no scene in it"),
        ({"scenes": [], "meshes": [{}, {}]}, "no scene in it"),
        ({"scenes": [{"nodes": []}], "scene": 3}, "scene 3 of 1"),
    ],
)
def test_gltf_without_a_scene_is_refused(
    tmp_path: Path, content: dict[str, Any], reason: str
) -> None:
    (tmp_path / "library.gltf").write_text(json.dumps({"asset": {"version": "2.0"}} | content))
    expect_error(tmp_path / "library.gltf", reason)


@pytest.mark.parametrize("suffix", [".glb", ".gltf", ".obj", ".ply", ".stl"])
def test_a_named_pipe_is_not_waited_for(tmp_path: Path, suffix: str) -> None:
    os.mkfifo(tmp_path / f"pipe{suffix}")
    expect_error(tmp_path / f"pipe{suffix}", "expected a file, found a named pipe")


def test_an_unknown_suffix_lists_the_known_ones(tmp_path: Path) -> None:
    path = tmp_path / "a.blend"
    path.write_bytes(b"BLENDER")
    expect_error(path, "'.blend'", ".glb, .gltf, .obj, .ply, .stl")


@pytest.mark.parametrize("share", [0.05, 0.5, 0.999])
@pytest.mark.parametrize("suffix", [".glb", ".stl", ".ply"])
def test_truncated_files_are_refused(tmp_path: Path, suffix: str, share: float) -> None:
    path = save(tmp_path / f"cut{suffix}", lopsided())
    data = path.read_bytes()
    path.write_bytes(data[: max(1, int(share * len(data)))])
    expect_error(path)


@pytest.mark.parametrize("suffix", [".glb", ".gltf", ".obj", ".ply", ".stl"])
def test_rubbish_is_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"rubbish{suffix}"
    path.write_bytes(np.random.default_rng(5).bytes(4000))
    expect_error(path)


@pytest.mark.parametrize(
    ("header", "tail"),
    [(b"exported", b"\0" * 7), (b"solid part", b""), (b"solid part", b"note " * 30)],
)
@pytest.mark.parametrize("count", [320, 0, 0xFFFFFFFF])
def test_an_stl_is_read_to_its_last_triangle(
    tmp_path: Path, header: bytes, tail: bytes, count: int
) -> None:
    path = save(tmp_path / "a.stl", lopsided())
    whole = load_scene(path)
    data = path.read_bytes()
    tail = tail if count == 320 else tail[:7]  # without a count, all that fits is triangles
    path.write_bytes(header.ljust(80) + count.to_bytes(4, "little") + data[84:] + tail)
    np.testing.assert_array_equal(load_scene(path).vertices, whole.vertices)


def test_points_without_faces_are_refused(tmp_path: Path) -> None:
    points = trimesh.PointCloud(np.random.default_rng(0).random((50, 3)))
    expect_error(save(tmp_path / "cloud.ply", points), "0 faces", "point cloud")
    (tmp_path / "points.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    expect_error(tmp_path / "points.obj", "0 faces")
    assert not list(tmp_path.glob("*.glb"))


def test_only_faces_without_area_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "line.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nf 1 2 3\nf 2 3 4\nf 1 1 1\n")
    expect_error(path, "none of its 3 faces")


def gltf_folder(folder: Path, kind: str = "baseColorTexture") -> Path:
    """A .gltf with its buffer and the map of this kind in separate files."""
    maps: dict[str, Any] = {"baseColorTexture": checker(8), kind: checker()}
    exported: Any = textured_square(**maps).export(file_type="gltf")
    for name, data in exported.items():
        (folder / name).write_bytes(data)
    path = folder / "model.gltf"
    header = json.loads(path.read_text())
    material = header["materials"][0]
    entry = material[kind] if kind in material else material["pbrMetallicRoughness"][kind]
    image = header["images"][header["textures"][entry["index"]]["source"]]
    checker().save(folder / "paint on wood.png")
    image.clear()
    image["uri"] = "paint%20on%20wood.png"
    path.write_text(json.dumps(header))
    return path


@pytest.mark.parametrize(
    ("suffix", "encoding"),
    [(each, "utf-8-sig") for each in (".obj", ".gltf", ".ply", ".stl")] + [(".obj", "utf-16")],
)
def test_a_mark_of_the_encoding_changes_nothing(tmp_path: Path, suffix: str, encoding: str) -> None:
    if suffix == ".gltf":
        path, texts = gltf_folder(tmp_path), ["*.gltf"]
    elif suffix == ".obj":
        path, texts = tmp_path / "s.obj", ["*.obj", "*.mtl"]
        path.write_text(OBJ)
        (tmp_path / "s.mtl").write_text("newmtl paint\nKd 1 0 0\n")
    else:
        kind: Any = {".ply": {"encoding": "ascii"}, ".stl": {"file_type": "stl_ascii"}}[suffix]
        text: Any = lopsided().export(**{"file_type": suffix[1:]} | kind)
        path, texts = tmp_path / f"a{suffix}", [f"*{suffix}"]
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    plain = load_scene(path)
    for each in (each for pattern in texts for each in tmp_path.glob(pattern)):
        each.write_text(each.read_text(), encoding=encoding)
    marked = load_scene(path)
    np.testing.assert_array_equal(marked.vertices, plain.vertices)
    np.testing.assert_array_equal(marked.materials[0].base_color, plain.materials[0].base_color)
    if suffix == ".gltf":
        np.testing.assert_array_equal(marked.materials[0].texture, np.asarray(checker()))


@pytest.mark.parametrize("kind", ["buffer", "image"])
def test_a_missing_file_of_a_gltf_is_named(tmp_path: Path, kind: str) -> None:
    path = gltf_folder(tmp_path)
    if kind == "buffer":
        missing = next(tmp_path.glob("*.bin"))
    else:
        missing = tmp_path / "paint on wood.png"
    missing.unlink()
    expect_error(path, f"its {kind} '{missing.name}' is missing", "copy the whole folder")


def test_a_damaged_texture_is_an_error(tmp_path: Path) -> None:
    path = gltf_folder(tmp_path)
    image = tmp_path / "paint on wood.png"
    image.write_bytes(image.read_bytes()[:60])
    expect_error(path, "paint")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("materials", 7),
        ("materials", [{"pbrMetallicRoughness": 1}]),
        ("materials", [{"extensions": []}]),
        ("materials", [{"extensions": {"KHR_materials_transmission": 0.5}}]),
        ("buffers", "x"),
        ("images", [{"uri": 3}]),
        ("extensionsUsed", True),
    ],
)
def test_a_gltf_header_of_other_types_is_refused(tmp_path: Path, key: str, value: object) -> None:
    header = {"asset": {"version": "2.0"}, "scenes": [{"nodes": []}]} | {key: value}
    (tmp_path / "a.gltf").write_text(json.dumps(header))
    expect_error(tmp_path / "a.gltf")
    assert tmp_path / "a.gltf" in mesh_files(tmp_path / "a.gltf")


def write_obj(folder: Path, line: str) -> Path:
    """An OBJ whose material has this line in its MTL; its own color is a blue."""
    (folder / "s.obj").write_text(OBJ)
    (folder / "s.mtl").write_text(f"newmtl paint\nKd 0 0 1\n{line}\n")
    return folder / "s.obj"


@pytest.mark.parametrize("line", ["Kd 1", "Kd 1 0", "Kd"])
def test_a_color_of_fewer_numbers_is_a_color(tmp_path: Path, line: str) -> None:
    (material,) = load_scene(write_obj(tmp_path, line), unit="m").materials
    assert np.shape(material.base_color) == (3,)
    assert (material.base_color == 1).all() == (line == "Kd 1")


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


@pytest.mark.parametrize("kind", ["normalTexture", "metallicRoughnessTexture"])
def test_maps_of_a_gltf_that_are_damaged_are_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, kind: str
) -> None:
    path = gltf_folder(tmp_path, kind)
    (tmp_path / "paint on wood.png").write_bytes(b"no image")
    load_scene(path)
    assert "'paint%20on%20wood.png' cannot be decoded" in caplog.text
    assert "drawn without it" in caplog.text


def obj(folder: Path) -> tuple[Path, list[str]]:
    (folder / "mug.obj").write_text(
        "mtllib mug.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    )
    (folder / "mug.mtl").write_text(
        "newmtl a\nmap_Kd -s 1 1 paint two.png\n  bump ROUGH.png\nmap_Ks gone.png\n"
    )
    (folder / "paint two.png").write_bytes(b"1")
    (folder / "rough.png").write_bytes(b"2")
    return folder / "mug.obj", ["mug.obj", "mug.mtl", "paint two.png", "rough.png"]


def gltf(folder: Path) -> tuple[Path, list[str]]:
    header = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": []}],
        "buffers": [{"uri": "mug.bin", "byteLength": 1}],
        "images": [{"uri": "my%20paint.png"}, {"uri": "data:image/png;base64,AA=="}, {}],
    }
    (folder / "mug.gltf").write_text(json.dumps(header))
    (folder / "mug.bin").write_bytes(b"1")
    (folder / "my paint.png").write_bytes(b"2")
    return folder / "mug.gltf", ["mug.gltf", "mug.bin", "my paint.png"]


def ply(folder: Path) -> tuple[Path, list[str]]:
    (folder / "mug.ply").write_text(
        "ply\nformat ascii 1.0\ncomment TextureFile mug.png\nend_header\n"
    )
    (folder / "mug.png").write_bytes(b"1")
    return folder / "mug.ply", ["mug.ply", "mug.png"]


@pytest.mark.parametrize("make", [obj, gltf, ply])
def test_materials_textures_and_buffers_belong_to_a_mesh(make, tmp_path: Path) -> None:
    path, names = make(tmp_path)
    assert [each.name for each in mesh_files(path)] == names
