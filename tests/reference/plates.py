"""Flat scenes whose images are known in closed form."""

import numpy as np
from numpy.typing import ArrayLike

from digs_warp.sim.scene.scene import Material, Scene


def plate(
    center: ArrayLike, right: ArrayLike, up: ArrayLike, material: Material, repeat: float = 1.0
) -> Scene:
    """A parallelogram, center +- right +- up, seen from right x up; the texture repeats across it."""
    c, r, u = (np.array(vector, np.float64) for vector in (center, right, up))
    normal = np.cross(r, u) / np.linalg.norm(np.cross(r, u))
    return Scene(
        vertices=np.array([c - r - u, c + r - u, c + r + u, c - r + u], np.float32),
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        face_materials=np.zeros(2, np.int32),
        normals=np.tile(normal, (4, 1)).astype(np.float32),
        uvs=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32) * np.float32(repeat),
        vertex_colors=np.ones((4, 3), np.float32),
        materials=(material,),
    )
