"""Flat scenes whose images are known in closed form."""

import numpy as np

from digs_warp.sim.scene import Material, Scene

Vector = tuple[float, float, float]


def plate(center: Vector, right: Vector, up: Vector, material: Material) -> Scene:
    """A parallelogram, center +- right +- up, with the texture once across, seen from right x up."""
    c, r, u = (np.array(vector, np.float64) for vector in (center, right, up))
    normal = np.cross(r, u) / np.linalg.norm(np.cross(r, u))
    return Scene(
        vertices=np.array([c - r - u, c + r - u, c + r + u, c - r + u], np.float32),
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        face_materials=np.zeros(2, np.int32),
        normals=np.tile(normal, (4, 1)).astype(np.float32),
        uvs=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32),
        vertex_colors=np.ones((4, 3), np.float32),
        materials=(material,),
    )
