"""Bad faces, damaged and missing files: dropped with a word, or refused with a clear one."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from digs_warp.checks import MeshError
from digs_warp.sim.scene.load import load_scene
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


def gltf_folder(tmp_path: Path) -> Path:
    """A .gltf with its buffer and its texture in separate files."""
    exported: Any = textured_square(baseColorTexture=checker()).export(file_type="gltf")
    for name, data in exported.items():
        (tmp_path / name).write_bytes(data)
    path = next(tmp_path.glob("*.gltf"))
    header = json.loads(path.read_text())
    image = header["images"][0]
    checker().save(tmp_path / "paint on wood.png")
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
