"""The pieces of a loaded mesh file, placed in the file's own frame."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from digs_warp.data.images import linear_from_srgb


@dataclass(frozen=True, eq=False)
class MeshPart:
    """One primitive with one material, in the frame and units of its file.

    Attributes:
        vertices: positions, shape (n, 3), float64.
        faces: vertex indices, shape (m, 3), int64.
        normals: vertex normals as the file has them, shape (n, 3), float64; NaN: none.
        uvs: texture coordinates, v = 0 is the bottom row, shape (n, 2), float64; None: none.
        colors: linear RGB in 0..1, shape (n, 3), float32; 1 where the file has none.
        material: a material of trimesh, or None.
        colored: whether the file has colors per vertex or per face.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray | None
    colors: np.ndarray
    material: Any
    colored: bool


def parts_of_scene(loaded: Any) -> list[MeshPart]:
    """Return every triangle mesh of a `trimesh.Scene`, whose vertex colors are sRGB; not points and lines."""
    import trimesh

    parts = []
    for node in loaded.graph.nodes_geometry:
        transform, name = loaded.graph[node]
        geometry = loaded.geometry[name]
        if isinstance(geometry, trimesh.Trimesh) and len(geometry.faces):
            parts.append(_part(geometry, np.asarray(transform, np.float64)))
    return parts


def _part(mesh: Any, world_from_node: np.ndarray) -> MeshPart:
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    normals, uvs = _file_normals(mesh), _uvs(mesh)
    colors, per_face = _file_colors(mesh)
    if per_face:
        _check_corners(faces, len(vertices))
        corners = faces.reshape(-1)
        vertices, normals = vertices[corners], normals[corners]
        uvs = None if uvs is None else uvs[corners]
        colors = None if colors is None else np.repeat(colors, 3, axis=0)
        faces = np.arange(len(corners)).reshape(-1, 3)
    colors = None if colors is None else linear_from_srgb(colors)
    material = getattr(mesh.visual, "material", None)
    return mesh_part(vertices, faces, normals, uvs, colors, material, world_from_node)


def mesh_part(
    vertices: np.ndarray,
    faces: np.ndarray,
    normals: np.ndarray,
    uvs: np.ndarray | None,
    colors: np.ndarray | None,
    material: Any,
    world_from_node: np.ndarray,
) -> MeshPart:
    """Return a part moved from its node to the frame of the file.

    Args:
        vertices: in the frame of the node; see `MeshPart`, also for the others.
        faces: likewise.
        normals: likewise, of any length.
        uvs: dropped if they are not of ``vertices``.
        colors: likewise, linear; None: none.
        material: of the file.
        world_from_node: shape (4, 4).

    Raises:
        ValueError: a face names a vertex that is not there.
    """
    _check_corners(faces, len(vertices))
    uvs, colors = (
        each if each is not None and len(each) == len(vertices) else None for each in (uvs, colors)
    )
    linear = world_from_node[:3, :3]
    if np.linalg.det(linear) < 0:  # a reflection reverses the winding
        faces = faces[:, ::-1]
    with np.errstate(
        invalid="ignore"
    ):  # infinite vertices become NaN; their faces are dropped later
        placed = vertices @ linear.T + world_from_node[:3, 3]
    return MeshPart(
        vertices=placed,
        faces=faces,
        normals=_turn_normals(normals, linear),
        uvs=None if uvs is None else np.nan_to_num(uvs, posinf=0.0, neginf=0.0),
        colors=np.ones((len(vertices), 3), np.float32)
        if colors is None
        else colors.astype(np.float32),
        material=material,
        colored=colors is not None,
    )


def _check_corners(faces: np.ndarray, count: int) -> None:
    for worst in (faces.min(), faces.max()):
        if not 0 <= worst < count:
            raise ValueError(f"a face names vertex {worst}, the file has {count}")


def _file_normals(mesh: Any) -> np.ndarray:
    """Return the normals of the file, NaN without; trimesh would compute missing ones."""
    if "vertex_normals" not in mesh._cache.cache:
        return np.full((len(mesh.vertices), 3), np.nan)
    return np.asarray(mesh.vertex_normals, np.float64)


def _turn_normals(normals: np.ndarray, linear: np.ndarray) -> np.ndarray:
    """Transform normals by the cofactors of a (3, 3) matrix: its inverse transpose, but safe if singular."""
    rows = (np.cross(linear[i - 2], linear[i - 1]) for i in range(3))
    cofactors = np.stack(list(rows)) * (-1 if np.linalg.det(linear) < 0 else 1)
    turned = normals @ cofactors.T
    length = np.linalg.norm(turned, axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return turned / length  # zero normals become NaN: none


def _uvs(mesh: Any) -> np.ndarray | None:
    uvs = getattr(mesh.visual, "uv", None)
    return None if uvs is None or np.shape(uvs)[1] < 2 else np.asarray(uvs, np.float64)[:, :2]


def _file_colors(mesh: Any) -> tuple[np.ndarray | None, bool]:
    """Return the stored colors, in 0..1, and whether they belong to faces instead of vertices."""
    visual = mesh.visual
    attributes = getattr(visual, "vertex_attributes", {})
    if visual.kind == "vertex":
        return unit_colors(visual.vertex_colors), False
    if visual.kind == "face":
        return unit_colors(visual.face_colors), True
    if "color" in attributes and len(attributes["color"]) == len(mesh.vertices):
        return unit_colors(attributes["color"]), False
    return None, False


def unit_colors(colors: Any) -> np.ndarray:
    """Convert stored RGB or RGBA of any type to RGB in 0..1, float32."""
    colors = np.asarray(colors)
    top = np.iinfo(colors.dtype).max if colors.dtype.kind in "iu" else 1.0
    return np.clip(np.nan_to_num(colors[:, :3].astype(np.float32) / top), 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Triangles:
    """All parts in one list of triangles, with the attributes of `Scene` in float64.

    Normals are NaN where there are none yet.
    """

    vertices: np.ndarray
    faces: np.ndarray
    face_materials: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray
    colors: np.ndarray


def join_parts(parts: Sequence[MeshPart], part_materials: Sequence[int]) -> Triangles:
    """Join parts into one list; ``part_materials`` is the material index of each."""
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    uvs = [np.zeros((len(p.vertices), 2)) if p.uvs is None else p.uvs for p in parts]
    return Triangles(
        vertices=np.concatenate([part.vertices for part in parts]),
        faces=np.concatenate(
            [part.faces + start for part, start in zip(parts, starts[:-1], strict=True)]
        ),
        face_materials=np.repeat(part_materials, [len(part.faces) for part in parts]),
        normals=np.concatenate([part.normals for part in parts]),
        uvs=np.concatenate(uvs),
        colors=np.concatenate([part.colors for part in parts]),
    )
