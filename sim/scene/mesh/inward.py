"""Whether a mesh is a room modeled from inside: its outer faces look inward."""

import numpy as np

from digs_warp.sim.scene.mesh.normalize import used_vertices
from digs_warp.sim.scene.mesh.normals import batches, face_normals
from digs_warp.sim.scene.mesh.parts import Triangles
from digs_warp.sim.scene.mesh.resting import hull_of

# Faces that look inward enclose at least this share of the hull: four walls and a floor enclose four fifths
# of it, a floor and two walls, where a camera can look in, half of it. What objects enclose is behind their
# faces, not before them.
ENCLOSED = 0.65


def looks_inward(triangles: Triangles) -> bool:
    """Whether the outer faces show their front to what they enclose, not to a camera around them.

    Where the mesh has normals, they tell the front of a face, else its winding.
    """
    hull = hull_of(used_vertices(triangles.vertices, triangles.faces))
    if hull is None:
        return False
    enclosed = 0.0  # signed: of the tetrahedra between the faces and a point inside, times 6
    for rows in batches(len(triangles.faces)):
        faces = triangles.faces[rows]
        fronts = face_normals(triangles.vertices, faces)
        told = np.einsum("ij,ij->i", fronts, triangles.normals[faces].sum(axis=1))
        away = triangles.vertices[faces[:, 0]] - hull.center
        volumes = np.einsum("ij,ij->i", fronts, away)
        enclosed += float(np.where(told < 0, -volumes, volumes).sum())
    return enclosed < -ENCLOSED * 6 * hull.volume
