"""All files that a mesh is read from: itself, and those that it names."""

import re
from pathlib import Path

from digs_warp.sim.scene.mesh.files_beside import locate, obj_materials, ply_textures
from digs_warp.sim.scene.mesh.gltf import read_gltf_header
from digs_warp.sim.scene.mesh.read import GLTF_SUFFIXES

# The lines of a material file that name a texture.
_TEXTURE = re.compile(rb"^\s*(?:map_\w+|bump|disp|decal|refl|norm)\s+(.+?)\s*$", re.MULTILINE)


def mesh_files(path: Path) -> list[Path]:
    """Return the mesh file and the materials, textures and buffers beside it that are there.

    Raises:
        MeshError: it is glTF with a broken header.
    """
    suffix = path.suffix.lower()
    if suffix in GLTF_SUFFIXES:
        header = read_gltf_header(path)
        entries = [*header.get("buffers", []), *header.get("images", [])]
        uris = [entry.get("uri", "") for entry in entries]
        return [path, *_there(path, [uri for uri in uris if not uri.startswith("data:")])]
    if suffix == ".ply":
        return [path, *_there(path, ply_textures(path))]
    if suffix == ".obj":
        materials = _there(path, obj_materials(path))
        textures = [name for each in materials for name in _found(_TEXTURE, each)]
        return [path, *materials, *_there(path, textures)]
    return [path]


def _found(pattern: re.Pattern[bytes], path: Path) -> list[str]:
    return [name.decode("utf-8", "replace") for name in pattern.findall(path.read_bytes())]


def _there(path: Path, names: list[str]) -> list[Path]:
    places = (locate(path.parent, name) for name in dict.fromkeys(names) if name)
    return [place for place in places if place is not None]
