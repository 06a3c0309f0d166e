"""Any mesh file as a `Scene`: z up, in its real size, centered on the origin."""

import logging
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import DigsError, MeshError, check_positive, require_file
from digs_warp.sim.mesh.files_beside import ply_textures, resolver_beside
from digs_warp.sim.mesh.gltf import (
    check_gltf,
    check_textures,
    read_extras,
    read_gltf_header,
    undecodable_images,
    unmodelled_features,
)
from digs_warp.sim.mesh.materials import materials_of_parts
from digs_warp.sim.mesh.normalize import box_of, drop_bad_faces, drop_unused_vertices, in_world
from digs_warp.sim.mesh.normals import fill_normals
from digs_warp.sim.mesh.parts import Triangles, join_parts, parts_of_scene
from digs_warp.sim.mesh.placement import (
    METRES_PER_UNIT,
    ROTATION_BY_UP_AXIS,
    Placement,
    guessed_scale,
    place,
    stated_scale,
)
from digs_warp.sim.mesh.promises import check_promises
from digs_warp.sim.mesh.resting import better_up_axis
from digs_warp.sim.scene import Material, Scene

logger = logging.getLogger(__name__)

# The axis that points up, by file format. glTF defines it; OBJ files mostly come from modelling programs
# (y), STL and PLY files from printing and scanning (z).
UP_AXIS_BY_SUFFIX = {".glb": "y", ".gltf": "y", ".obj": "y", ".ply": "z", ".stl": "z"}
GLTF_SUFFIXES = (".glb", ".gltf")


def load_scene(
    path: Path, size: float | None = None, up: str = "auto", unit: str = "auto"
) -> Scene:
    """Load a GLB, glTF, OBJ, PLY or STL file.

    A logged warning names parts that the renderer cannot show as intended (glass that bends light), textures
    of OBJ and PLY files that cannot be used, and faces that are dropped because they have no area or are not
    finite. Vertex colors are linear in glTF, as its standard says, and sRGB in the other formats.

    Args:
        path: the file; its textures and buffers are read relative to its folder.
        size: longest edge of the bounding box in the world [m]; None: that of the file.
        up: axis of the file that points up: "x", "y", "z", or "auto" for the convention of the format.
        unit: of the file: "m", "cm", "mm", "in", or "auto": metres for glTF, else a guess by the size.

    Raises:
        MeshError: missing, empty, truncated, unsupported, or without a single usable triangle.
    """
    _check_settings(size, up, unit)
    triangles, materials = _read_mesh(Path(path))
    placement = _placement(Path(path), triangles, size, up, unit)
    return _scene(triangles, materials, placement.world_from_mesh, placement)


def load_scene_at(path: Path, world_from_mesh: np.ndarray) -> Scene:
    """Load a mesh file at its pose in a recording.

    Args:
        path: the file.
        world_from_mesh: of the recording: `digs_warp.data.about.About.world_from_mesh`, shape (4, 4).

    Raises:
        MeshError: as `load_scene`.
    """
    return _scene(*_read_mesh(Path(path)), world_from_mesh)


def _read_mesh(path: Path) -> tuple[Triangles, tuple[Material, ...]]:
    """Return the usable triangles in the frame of the file, and their materials."""
    suffix = _checked_suffix(path)
    header = read_gltf_header(path) if suffix in GLTF_SUFFIXES else {}
    check_gltf(path, header)
    check_promises(path, header)
    for sentence in unmodelled_features(header):
        logger.warning("mesh '%s': %s", path.name, sentence)
    if suffix == ".ply" and len(names := ply_textures(path)) > 1:
        logger.warning(
            "mesh '%s': %d textures, drawn with '%s' alone", path.name, len(names), names[-1]
        )
    try:
        for sentence in undecodable_images(path, header):
            logger.warning("mesh '%s': %s", path.name, sentence)
        parts = parts_of_scene(_read(path), linear_colors=suffix in GLTF_SUFFIXES)
        check_textures(path, header, (part.material for part in parts))
        extras = read_extras(path, header)
        materials, part_materials = materials_of_parts(parts, extras)
    except (MeshError, ImportError):
        raise
    except DigsError as error:  # a texture beyond its bound
        raise MeshError(f"mesh '{path}': {error}") from None
    except Exception as error:  # trimesh's readers raise any kind of exception
        raise MeshError(
            f"mesh '{path}': cannot be read as {suffix[1:].upper()}, damaged or truncated "
            f"({type(error).__name__}: {error}); copy or export it again"
        ) from error
    if not parts:
        raise MeshError(
            f"mesh '{path}': 0 faces, expected triangles; turn a point cloud into a mesh first"
        )
    return _usable(path, join_parts(parts, part_materials)), materials


def _check_settings(size: float | None, up: str, unit: str) -> None:
    if size is not None:
        check_positive("size of the object [m]", size)
    if up != "auto" and up not in ROTATION_BY_UP_AXIS:
        raise MeshError(f"up axis '{up}': expected 'auto', 'x', 'y' or 'z'")
    if unit != "auto" and unit not in METRES_PER_UNIT:
        raise MeshError(f"unit '{unit}': expected 'auto', {', '.join(METRES_PER_UNIT)}")


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


def _read(path: Path) -> Any:
    """Return the file as a `trimesh.Scene`, vertices and faces as they are stored."""
    import trimesh

    file_type, resolver = path.suffix[1:].lower(), resolver_beside(path)
    log = trimesh.util.log
    usual, log.disabled = log.disabled, True  # it shows tracebacks of what the resolver has said
    try:
        return trimesh.load_scene(path, file_type=file_type, resolver=resolver, process=False)
    finally:
        log.disabled = usual


def _usable(path: Path, triangles: Triangles) -> Triangles:
    total = len(triangles.faces)
    triangles = drop_bad_faces(triangles, path.name)
    if not len(triangles.faces):
        raise MeshError(
            f"mesh '{path}': none of its {total} faces is usable (no area, or vertices that are not "
            "finite); repair or export it again"
        )
    return triangles


def _placement(
    path: Path, triangles: Triangles, size: float | None, up: str, unit: str
) -> Placement:
    """Return where the mesh goes; a guessed unit other than metres is worth a warning."""
    suffix = path.suffix.lower()
    low, high = box_of(triangles.vertices, triangles.faces)
    scale = stated_scale(size, unit, high - low, suffix in GLTF_SUFFIXES)
    axis = _usual_up_axis(path, triangles) if up == "auto" else up
    if scale is not None:
        return place(low, high, axis, scale)
    guess = guessed_scale(high - low, suffix[1:].upper())
    placement = place(low, high, axis, guess)
    in_metres = " x ".join(f"{side * guess.metres_per_unit:.3g}" for side in high - low)
    level = logging.INFO if guess.metres_per_unit == 1.0 else logging.WARNING
    logger.log(level, "mesh '%s': %s m; %s", path.name, in_metres, guess.origin)
    return placement


def _usual_up_axis(path: Path, triangles: Triangles) -> str:
    """Return the up axis of the format; warn of a mesh that lies with it."""
    up = UP_AXIS_BY_SUFFIX[path.suffix.lower()]
    better = better_up_axis(triangles.vertices[np.unique(triangles.faces)], up)
    if better is not None:
        logger.warning(
            "mesh '%s': lies on its side with %s up, as is usual for %s, but would stand with %s up; turn it "
            "with --up %s, or confirm with --up %s",
            *(path.name, up, path.suffix[1:].upper(), better, better, up),
        )
    return up


def _scene(
    triangles: Triangles,
    materials: tuple[Material, ...],
    world_from_mesh: np.ndarray,
    placement: Placement | None = None,
) -> Scene:
    """Return the triangles in the world."""
    triangles = drop_unused_vertices(fill_normals(in_world(triangles, world_from_mesh)))
    return Scene(
        vertices=triangles.vertices.astype(np.float32),
        faces=triangles.faces.astype(np.int32),
        face_materials=triangles.face_materials.astype(np.int32),
        normals=triangles.normals.astype(np.float32),
        uvs=triangles.uvs.astype(np.float32),
        vertex_colors=triangles.colors.astype(np.float32),
        materials=materials,
        placement=placement,
    )
