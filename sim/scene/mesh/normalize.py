"""Cleaned faces, and vertices moved from the frame of the file to the world."""

import logging
from dataclasses import replace

import numpy as np

from digs_warp.sim.scene.mesh.normals import batches, face_normals
from digs_warp.sim.scene.mesh.parts import Triangles

logger = logging.getLogger(__name__)

# With float32 positions, the area of a face below this share of the squared box edge cannot be told from 0.
MIN_FACE_AREA = 1e-14

# Exporters leave a few faces without area, which nothing shows. More of them say that the file is damaged.
USUAL_SHARE = 0.01


def drop_bad_faces(triangles: Triangles, name: str) -> Triangles:
    """Return the triangles without faces of zero area or with vertices that are not finite.

    Args:
        triangles: in any units.
        name: of the mesh, for the line that gives the counts: a warning, unless there are only a few faces
            without area.
    """
    faces = triangles.faces
    finite_vertices = np.logical_and.reduce(np.isfinite(triangles.vertices), axis=1)
    finite = np.logical_and.reduce(finite_vertices[faces], axis=1)
    kept = finite.copy()
    if finite.any():
        low, high = box_of(triangles.vertices, faces[finite])
        longest = max(float((high - low).max()), np.finfo(np.float64).tiny)
        # As the renderer sees them: in float32, around the origin.
        with np.errstate(invalid="ignore", over="ignore"):
            placed = ((triangles.vertices - low) / longest).astype(np.float32).astype(np.float64)
            for rows in batches(len(faces)):
                areas = 0.5 * np.linalg.norm(face_normals(placed, faces[rows]), axis=1)
                kept[rows] &= areas > MIN_FACE_AREA
    if kept.all():
        return triangles
    is_usual = finite.all() and (~kept).sum() <= USUAL_SHARE * len(faces)
    logger.log(
        logging.INFO if is_usual else logging.WARNING,
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
    used = _used(triangles.vertices, triangles.faces)
    number = np.cumsum(used) - 1
    return Triangles(
        vertices=triangles.vertices[used],
        faces=number[triangles.faces],
        face_materials=triangles.face_materials,
        normals=triangles.normals[used],
        uvs=triangles.uvs[used],
        colors=triangles.colors[used],
    )


def in_world(triangles: Triangles, world_from_mesh: np.ndarray) -> Triangles:
    """Return the triangles in the world.

    Args:
        triangles: in the frame of their file.
        world_from_mesh: rotation, scale and translation, shape (4, 4).
    """
    linear = world_from_mesh[:3, :3]
    return replace(
        triangles,
        vertices=triangles.vertices @ linear.T + world_from_mesh[:3, 3],
        normals=triangles.normals @ (linear / np.cbrt(np.linalg.det(linear))).T,
    )


def box_of(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and highest coordinates of the vertices that the faces use, shape (3,) each."""
    used = used_vertices(vertices, faces)
    return used.min(axis=0), used.max(axis=0)


def used_vertices(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the vertices that the faces use, in their order, shape (k, 3)."""
    return vertices[_used(vertices, faces)]


def _used(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return which vertices the faces use, shape (n,), bool."""
    used = np.zeros(len(vertices), bool)
    used[faces.reshape(-1)] = True
    return used
