"""The files that a mesh is read from, for a cache that must notice when one changes."""

import json
from pathlib import Path

import pytest

from digs_warp.sim.scene.mesh.read import mesh_files


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
