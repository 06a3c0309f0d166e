"""The pieces of a loaded mesh file, placed in the file's own frame."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

UNMOVED = np.eye(4)


@dataclass(frozen=True, eq=False)
class MeshPart:
    """One primitive with one material, in the frame and units of its file.

    Attributes:
        vertices: positions, shape (n, 3), float64.
        faces: vertex indices, shape (m, 3), int64.
        normals: vertex normals as the file has them, shape (n, 3), float64; NaN: none.
        uvs: texture coordinates, v = 0 is the bottom row, shape (n, 2), float64; None: none.
        colors: linear RGB in 0..1, shape (n, 3), float32; 1 where the file has none.
        material: what stands for it in the file, or None.
        colored: whether the file has colors per vertex or per face.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray | None
    colors: np.ndarray
    material: Any
    colored: bool


def mesh_part(
    vertices: np.ndarray,
    faces: np.ndarray,
    normals: np.ndarray,
    uvs: np.ndarray | None,
    colors: np.ndarray | None,
    material: Any,
    world_from_node: np.ndarray = UNMOVED,
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
    for worst in (faces.min(), faces.max()):
        if not 0 <= worst < len(vertices):
            raise ValueError(f"a face names vertex {worst}, the file has {len(vertices)}")
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


def _turn_normals(normals: np.ndarray, linear: np.ndarray) -> np.ndarray:
    """Transform normals by the cofactors of a (3, 3) matrix: its inverse transpose, but safe if singular."""
    rows = (np.cross(linear[i - 2], linear[i - 1]) for i in range(3))
    cofactors = np.stack(list(rows)) * (-1 if np.linalg.det(linear) < 0 else 1)
    turned = normals @ cofactors.T
    length = np.linalg.norm(turned, axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return turned / length  # zero normals become NaN: none


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
