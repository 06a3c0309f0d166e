"""Small scenes by their arrays; flat ones have images that are known in closed form."""

import numpy as np
from numpy.typing import ArrayLike

from digs_warp.sim.scene.scene import Material, Scene


def plate(
    center: ArrayLike, right: ArrayLike, up: ArrayLike, material: Material, repeat: float = 1.0
) -> Scene:
    """A parallelogram, center +- right +- up, seen from right x up; the texture repeats across it."""
    c, r, u = (np.array(vector, np.float64) for vector in (center, right, up))
    normal = np.cross(r, u) / np.linalg.norm(np.cross(r, u))
    corners = np.array([c - r - u, c + r - u, c + r + u, c - r + u])
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * repeat
    return scene_of(corners, [[0, 1, 2], [0, 2, 3]], np.tile(normal, (4, 1)), material, uvs)


def scene_of(
    vertices: np.ndarray,
    faces: ArrayLike,
    normals: np.ndarray,
    material: Material,
    uvs: np.ndarray | None = None,
) -> Scene:
    """Triangles of one material, as one object."""
    uvs = np.zeros((len(vertices), 2)) if uvs is None else uvs
    corners = np.asarray(faces, np.int32)
    return Scene(
        vertices=np.asarray(vertices, np.float32),
        faces=corners,
        face_materials=np.zeros(len(corners), np.int32),
        normals=np.asarray(normals, np.float32),
        uvs=np.asarray(uvs, np.float32),
        vertex_colors=np.ones((len(vertices), 3), np.float32),
        materials=(material,),
    )
