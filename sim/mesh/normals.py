"""Vertex normals for meshes that come without them."""

from dataclasses import replace

import numpy as np

from digs_warp.sim.mesh.parts import Triangles

# Faces that meet at a larger angle keep a sharp edge between them: a sphere of 16 segments (22 degrees)
# still looks round, the sides of a box stay flat.
CREASE_DEGREES = 40.0

# Normals that differ by less are the same: the order of a sum changes its last bits.
SAME_NORMAL = 1e-4


def face_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return face normals whose length is twice the area of the face, shape (m, 3)."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return np.cross(b - a, c - a)


def fill_normals(triangles: Triangles) -> Triangles:
    """Return the triangles with a unit normal at every vertex and windings that agree with them.

    Normals of the file are kept. The others are means over the faces around a vertex; vertices on sharp
    edges are duplicated. glTF requires flat faces where normals are missing, but files without normals are
    mostly scans of round objects, so all formats are smoothed.
    """
    missing = np.isnan(triangles.normals.sum(axis=1))
    if missing.any():
        triangles = _with_computed_normals(triangles, missing)
    facing = np.einsum(
        "ij,ij->i",
        face_normals(triangles.vertices, triangles.faces),
        triangles.normals[triangles.faces].sum(axis=1),
    )
    faces = np.where((facing < 0)[:, None], triangles.faces[:, ::-1], triangles.faces)
    return replace(triangles, faces=faces)


def _with_computed_normals(triangles: Triangles, missing: np.ndarray) -> Triangles:
    chosen = missing[triangles.faces].any(axis=1)
    faces = triangles.faces[chosen]
    corners = faces.reshape(-1)
    normals = corner_normals(triangles.vertices, faces)
    keeps_own = ~missing[corners]
    normals[keeps_own] = triangles.normals[corners[keeps_own]]

    # Corners become one vertex again where position, texture, color and normal are the same.
    rows = np.hstack([triangles.vertices, triangles.uvs, triangles.colors])[corners]
    keys = np.hstack([rows, np.round(normals / SAME_NORMAL) + 0.0])
    first, inverse = unique_rows(keys)
    new_faces = triangles.faces.copy()
    new_faces[chosen] = len(triangles.vertices) + inverse.reshape(-1, 3)
    source = corners[first]
    return Triangles(
        vertices=np.concatenate([triangles.vertices, triangles.vertices[source]]),
        faces=new_faces,
        face_materials=triangles.face_materials,
        normals=np.concatenate([triangles.normals, normals[first]]),
        uvs=np.concatenate([triangles.uvs, triangles.uvs[source]]),
        colors=np.concatenate([triangles.colors, triangles.colors[source]]),
    )


def corner_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the unit normal of every corner, shape (3 m, 3).

    The mean over the faces that share the corner's position and meet within the crease angle, weighted by
    their angles at the corner (Thuermer and Wuethrich, "Computing Vertex Normals from Polygonal Facets",
    1998), so that it does not depend on how a surface was cut into triangles.
    """
    unit = face_normals(vertices, faces)
    unit /= np.maximum(np.linalg.norm(unit, axis=1, keepdims=True), 1e-300)
    own = np.repeat(unit, 3, axis=0)
    weighted = own * _corner_angles(vertices, faces).reshape(-1, 1)

    # Corners sorted by position: those of one position are contiguous, [start, start + count).
    _, place = unique_rows(vertices[faces.reshape(-1)])
    order = np.argsort(place, kind="stable")
    counts = np.bincount(place)
    starts = np.cumsum(counts) - counts
    rank = np.empty(len(place), np.int64)
    rank[order] = np.arange(len(place)) - starts[place[order]]

    total = weighted.copy()
    cosine = np.cos(np.radians(CREASE_DEGREES))
    # Step k adds to every corner the k-th next one at its position.
    for step in range(1, counts.max()):
        here = np.flatnonzero(counts[place] > step)
        group = place[here]
        other = order[starts[group] + (rank[here] + step) % counts[group]]
        smooth = np.einsum("ij,ij->i", own[here], own[other]) > cosine
        total[here[smooth]] += weighted[other[smooth]]
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)


def _corner_angles(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the inner angles of the triangles [rad], shape (m, 3)."""
    corners = vertices[faces]
    to_next = np.roll(corners, -1, axis=1) - corners
    to_last = np.roll(corners, 1, axis=1) - corners
    cross = np.linalg.norm(np.cross(to_next, to_last), axis=2)
    return np.arctan2(cross, (to_next * to_last).sum(axis=2))


def unique_rows(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the index of the first occurrence of each unique row, and the unique row of every row."""
    order = np.lexsort(rows.T)
    ordered = rows[order]
    is_new = np.concatenate([[True], (ordered[1:] != ordered[:-1]).any(axis=1)])
    inverse = np.empty(len(rows), np.int64)
    inverse[order] = np.cumsum(is_new) - 1
    return order[is_new], inverse
