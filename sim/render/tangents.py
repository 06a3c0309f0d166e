"""Directions of the texture on the surface, for normal maps.

Vertex tangents are means over the faces round a vertex, weighted by area, as the programs that bake normal
maps make them; vertices are already split along the seams of the texture.
"""

import numpy as np

from digs_warp.sim.scene import Scene

# Below this, a tangent is no direction: mirrored halves cancel out, or the texture has no extent.
MIN_LENGTH = 1e-12


def vertex_tangents(scene: Scene) -> np.ndarray:
    """Return the unit direction in which u grows at each vertex, (n, 3), float32; 0: none."""
    along_u = _face_tangents(scene)
    total = np.zeros((len(scene.vertices), 3))
    for corner in range(3):
        np.add.at(total, scene.faces[:, corner], along_u)
    normals = scene.normals.astype(np.float64)
    total -= (total * normals).sum(axis=1, keepdims=True) * normals
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > MIN_LENGTH, total / np.maximum(length, MIN_LENGTH), 0.0).astype(
        np.float32
    )


def face_handedness(scene: Scene) -> np.ndarray:
    """Return 1 where (u, v, normal) is right-handed and -1 where the texture is mirrored, (m,), float32."""
    edges, uv_area = _edges_and_uv_area(scene)
    outward = np.cross(edges[0], edges[1])
    along = (outward * scene.normals[scene.faces].sum(axis=1)).sum(axis=1)
    return np.where(uv_area * along < 0, -1.0, 1.0).astype(np.float32)


def _face_tangents(scene: Scene) -> np.ndarray:
    """Return dP/du of each face times its area in the world, shape (m, 3)."""
    (ab, ac), uv_area = _edges_and_uv_area(scene)
    a, b, c = np.moveaxis(scene.uvs[scene.faces].astype(np.float64), 1, 0)
    along_u = (c - a)[:, 1:] * ab - (b - a)[:, 1:] * ac
    along_u *= np.sign(uv_area)[:, None]
    length = np.maximum(np.linalg.norm(along_u, axis=1, keepdims=True), 1e-300)
    return along_u / length * np.linalg.norm(np.cross(ab, ac), axis=1, keepdims=True)


def _edges_and_uv_area(scene: Scene) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Return the two edges at the first corner, (m, 3) each, and twice the signed area in the texture."""
    a, b, c = np.moveaxis(scene.vertices[scene.faces].astype(np.float64), 1, 0)
    ua, ub, uc = np.moveaxis(scene.uvs[scene.faces].astype(np.float64), 1, 0)
    ab, ac = ub - ua, uc - ua
    return (b - a, c - a), ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
