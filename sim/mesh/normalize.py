"""Cleaned faces, z up, one standard size: every object is captured from the same distances."""

import logging
from dataclasses import replace

import numpy as np

from digs_warp.sim.mesh.normals import face_normals
from digs_warp.sim.mesh.parts import Triangles

logger = logging.getLogger(__name__)

# Longest edge of the bounding box [m]. The cameras of the default trajectory are about a metre away, where a
# stereo camera measures well; all published figures of this project are for objects of this size.
STANDARD_SIZE = 0.5

# With float32 positions, the area of a face below this share of the squared box edge cannot be told from 0.
MIN_FACE_AREA = 1e-14

# world_from_source rotations by the axis that points up in the source.
ROTATION_BY_UP_AXIS = {
    "x": np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "z": np.eye(3),
}


def drop_bad_faces(triangles: Triangles, name: str) -> Triangles:
    """Return the triangles without faces of zero area or with vertices that are not finite.

    Args:
        triangles: in any units.
        name: of the mesh, for the warning that gives the counts.
    """
    faces = triangles.faces
    finite = np.isfinite(triangles.vertices[faces]).all(axis=(1, 2))
    kept = finite.copy()
    if finite.any():
        low, high = _box(triangles.vertices, faces[finite])
        longest = max(float((high - low).max()), np.finfo(np.float64).tiny)
        # As the renderer sees them: in float32, at the standard size.
        with np.errstate(invalid="ignore", over="ignore"):
            placed = ((triangles.vertices - low) / longest).astype(np.float32).astype(np.float64)
            areas = 0.5 * np.linalg.norm(face_normals(placed, faces), axis=1)
        kept &= areas > MIN_FACE_AREA
    if kept.all():
        return triangles
    logger.warning(
        "mesh '%s': dropped %d of %d faces (%d with vertices that are not finite, %d without area)",
        name,
        len(faces) - kept.sum(),
        len(faces),
        len(faces) - finite.sum(),
        finite.sum() - kept.sum(),
    )
    return replace(triangles, faces=faces[kept], face_materials=triangles.face_materials[kept])


def drop_unused_vertices(triangles: Triangles) -> Triangles:
    """Return the triangles without unused vertices."""
    used, faces = np.unique(triangles.faces, return_inverse=True)
    return Triangles(
        vertices=triangles.vertices[used],
        faces=faces.reshape(-1, 3),
        face_materials=triangles.face_materials,
        normals=triangles.normals[used],
        uvs=triangles.uvs[used],
        colors=triangles.colors[used],
    )


def place_upright(triangles: Triangles, up: str, size: float) -> tuple[Triangles, float]:
    """Turn the axis ``up`` ("x", "y" or "z") to z, center the box, scale its longest edge to ``size`` [m].

    Returns:
        The triangles in the world, and the metres per unit of the source.
    """
    rotation = ROTATION_BY_UP_AXIS[up]
    low, high = _box(triangles.vertices, triangles.faces)
    scale = size / float((high - low).max())
    vertices = (triangles.vertices - (low + high) / 2) * scale
    placed = replace(
        triangles, vertices=vertices @ rotation.T, normals=triangles.normals @ rotation.T
    )
    return placed, scale


def _box(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and highest coordinates of the vertices that the faces use, shape (3,) each."""
    used = vertices[np.unique(faces)]
    return used.min(axis=0), used.max(axis=0)
