"""The scene that is captured: one triangle mesh with materials, standing at the origin, z up, in metres."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Material:
    """How a surface looks; a subset of glTF's metallic-roughness model.

    Attributes:
        name: label for messages and reports.
        base_color: linear RGB factor in 0..1, shape (3,); multiplies the texture and vertex colours.
        texture: sRGB base-colour image, shape (height, width, 3), uint8, row 0 on top; None: plain.
        roughness: perceptual roughness, 0 (mirror) to 1.
        metallic: 0 (dielectric) to 1 (metal).
    """

    name: str
    base_color: np.ndarray
    texture: np.ndarray | None = None
    roughness: float = 1.0
    metallic: float = 0.0


@dataclass(frozen=True, eq=False)
class Scene:
    """A triangle soup in the world: z up, metres, centred on the origin.

    Attributes:
        vertices: positions [m], shape (n, 3), float32.
        faces: vertex indices, shape (m, 3), int32, no degenerate faces, m >= 1.
        face_materials: index into ``materials`` of each face, shape (m,), int32.
        normals: unit vertex normals, shape (n, 3), float32.
        uvs: texture coordinates, shape (n, 2), float32; v = 0 is the bottom row of the image, values
            outside 0..1 repeat.
        vertex_colors: linear RGB in 0..1, shape (n, 3), float32; 1 where the mesh has none.
        materials: at least one.
        scale_applied: metres in this scene per unit of the source file.
    """

    vertices: np.ndarray
    faces: np.ndarray
    face_materials: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray
    vertex_colors: np.ndarray
    materials: tuple[Material, ...]
    scale_applied: float = 1.0

    @property
    def radius(self) -> float:
        """Radius of the smallest sphere around the origin that holds every vertex [m]."""
        return float(np.linalg.norm(self.vertices, axis=1).max())
