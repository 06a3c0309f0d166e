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


def parts_of_scene(loaded: Any, linear_colors: bool) -> list[MeshPart]:
    """Return every triangle mesh of a trimesh scene, once per node that shows it.

    Args:
        loaded: a `trimesh.Scene`; points and lines in it are ignored.
        linear_colors: whether vertex colors are linear (glTF says so) or sRGB (what PLY and OBJ hold).
    """
    import trimesh

    parts = []
    for node in loaded.graph.nodes_geometry:
        transform, name = loaded.graph[node]
        geometry = loaded.geometry[name]
        if isinstance(geometry, trimesh.Trimesh) and len(geometry.faces):
            parts.append(_part(geometry, np.asarray(transform, np.float64), linear_colors))
    return parts


def _part(mesh: Any, world_from_node: np.ndarray, linear_colors: bool) -> MeshPart:
    vertices = np.asarray(mesh.vertices, np.float64)
    faces = np.asarray(mesh.faces, np.int64)
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError(
            f"a face names vertex {faces.max() if faces.min() >= 0 else faces.min()}, "
            f"the file has {len(vertices)}"
        )
    normals = _file_normals(mesh)
    uvs = _uvs(mesh)
    colors, per_face = _file_colors(mesh)
    if per_face:
        corners = faces.reshape(-1)
        vertices, normals = vertices[corners], normals[corners]
        uvs = None if uvs is None else uvs[corners]
        colors = None if colors is None else np.repeat(colors, 3, axis=0)
        faces = np.arange(len(corners)).reshape(-1, 3)
    colored = colors is not None
    if colors is None:
        colors = np.ones((len(vertices), 3), np.float32)
    elif not linear_colors:
        colors = linear_from_srgb(colors)

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
        uvs=uvs,
        colors=colors.astype(np.float32),
        material=getattr(mesh.visual, "material", None),
        colored=colored,
    )


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
    if uvs is None or len(uvs) != len(mesh.vertices) or np.shape(uvs)[1] < 2:
        return None
    return np.nan_to_num(np.asarray(uvs, np.float64)[:, :2], posinf=0.0, neginf=0.0)


def _file_colors(mesh: Any) -> tuple[np.ndarray | None, bool]:
    """Return the stored colors, in 0..1, and whether they belong to faces instead of vertices."""
    visual = mesh.visual
    attributes = getattr(visual, "vertex_attributes", {})
    if visual.kind == "vertex":
        return _unit_colors(visual.vertex_colors), False
    if visual.kind == "face":
        return _unit_colors(visual.face_colors), True
    if "color" in attributes and len(attributes["color"]) == len(mesh.vertices):
        return _unit_colors(attributes["color"]), False
    return None, False


def _unit_colors(colors: Any) -> np.ndarray:
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
