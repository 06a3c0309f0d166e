"""Reads a mesh file of any format: triangles in the file's frame, materials, and the files beside it."""

import logging
import re
from contextlib import suppress
from functools import partial
from pathlib import Path

from digs_warp.bounds import TRIANGLES
from digs_warp.checks import DigsError, MeshError, require_file
from digs_warp.data.ply_table import read_ply_header
from digs_warp.sim.scene.mesh.files_beside import FilesBeside, locate, obj_materials, ply_textures
from digs_warp.sim.scene.mesh.gltf import (
    check_counts,
    check_extensions,
    check_files,
    read_gltf_header,
)
from digs_warp.sim.scene.mesh.gltf_geometry import gltf_parts
from digs_warp.sim.scene.mesh.gltf_materials import GltfMaterials, unmodeled_features
from digs_warp.sim.scene.mesh.materials import Convert, materials_of_parts
from digs_warp.sim.scene.mesh.normalize import drop_bad_faces
from digs_warp.sim.scene.mesh.obj import mtl_material, obj_parts
from digs_warp.sim.scene.mesh.parts import MeshPart, Triangles, join_parts
from digs_warp.sim.scene.mesh.ply import ply_parts, stl_parts
from digs_warp.sim.scene.scene import Material
from digs_warp.words import cut

logger = logging.getLogger(__name__)

# The axis that points up, by file format. glTF defines it; OBJ files mostly come from modelling programs
# (y), STL and PLY files from printing and scanning (z).
UP_AXIS_BY_SUFFIX = {".glb": "y", ".gltf": "y", ".obj": "y", ".ply": "z", ".stl": "z"}
GLTF_SUFFIXES = (".glb", ".gltf")


def read_triangles(path: Path) -> tuple[Triangles, tuple[Material, ...]]:
    """Return the usable triangles in the frame of the file, and their materials.

    Raises:
        MeshError: missing, empty, truncated, unsupported, or without a single usable triangle.
    """
    suffix = _checked_suffix(path)
    try:
        parts, convert = _gltf(path) if suffix in GLTF_SUFFIXES else _other(path)
        TRIANGLES.check(f"mesh '{path}'", sum(len(part.faces) for part in parts))
        materials, part_materials = materials_of_parts(parts, convert)
    except (MeshError, ImportError):
        raise
    except DigsError as error:  # a bound
        where = "" if str(path) in str(error) else f"mesh '{path}': "
        raise MeshError(f"{where}{error}") from None
    except Exception as error:  # a header of other types, numbers that are none
        raise MeshError(
            f"mesh '{path}': cannot be read as {suffix[1:].upper()}, damaged or truncated "
            f"({type(error).__name__}: {error}); copy or export it again"
        ) from error
    if not parts:
        raise MeshError(f"mesh '{path}': 0 faces, expected triangles; {_cure(path)}")
    triangles = drop_bad_faces(join_parts(parts, part_materials), path.name)
    if not len(triangles.faces):
        raise MeshError(
            f"mesh '{path}': none of its {sum(len(part.faces) for part in parts)} faces is usable (no area, "
            "or vertices that are not finite); repair or export it again"
        )
    return triangles, materials


def _gltf(path: Path) -> tuple[list[MeshPart], Convert]:
    """Return the parts of a glTF file, and what converts their materials."""
    header = read_gltf_header(path)
    check_extensions(path, header)
    check_files(path, header)
    check_counts(path, header)
    for sentence in unmodeled_features(header):
        logger.warning("mesh '%s': %s", path.name, sentence)
    return gltf_parts(path, header), GltfMaterials(path, header).convert


def _other(path: Path) -> tuple[list[MeshPart], Convert]:
    """Return the same of another file."""
    files = FilesBeside(path)
    convert = partial(mtl_material, files)
    match path.suffix.lower():
        case ".obj":
            return obj_parts(path, files), convert
        case ".ply":
            if len(names := ply_textures(path)) > 1:
                used = cut(names[-1])
                logger.warning(
                    "mesh '%s': %d textures, drawn with '%s' alone", path.name, len(names), used
                )
            return ply_parts(path), convert
        case _:
            return stl_parts(path), convert


def _checked_suffix(path: Path) -> str:
    """Check that a file exists, is not empty and has a known format; return its suffix in lower case."""
    try:
        require_file(path, "mesh")
    except DigsError as error:
        raise MeshError(str(error)) from None
    suffix = path.suffix.lower()
    if suffix not in UP_AXIS_BY_SUFFIX:
        raise MeshError(
            f"mesh '{path}': suffix '{path.suffix}', expected one of {', '.join(UP_AXIS_BY_SUFFIX)}; "
            "convert it, for example with Blender"
        )
    return suffix


def _cure(path: Path) -> str:
    """Return what to do about a file without faces."""
    if path.suffix.lower() == ".stl":
        return "damaged, or no STL file; copy or export it again"
    if path.suffix.lower() == ".ply" and read_ply_header(path).holds_splats:
        return "these are Gaussian splats; 'digs-warp convert' reads them, 'digs-warp mesh' makes a mesh"
    return "turn a point cloud into a mesh first"


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
        with suppress(AttributeError, TypeError, ValueError):  # of other types: reading it says so
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
