"""Vertex normals for meshes that come without them."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from digs_warp.sim.scene.mesh.parts import Triangles

# Faces that meet at a larger angle keep a sharp edge between them: a sphere of 16 segments (22 degrees)
# still looks round, the sides of a box stay flat.
CREASE_DEGREES = 40.0

# Where thousands of faces meet, as in the tip of a cone, so many others count for each: pairs take minutes.
MOST_AT_A_PLACE = 1000

# Normals that differ by less are the same: the order of a sum changes its last bits.
SAME_NORMAL = 1e-4

_ROWS_AT_A_TIME = 1 << 17


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
    faces = triangles.faces.copy()
    for rows in batches(len(faces)):
        part = faces[rows]
        outward = triangles.normals[part].sum(axis=1)
        facing = np.einsum("ij,ij->i", face_normals(triangles.vertices, part), outward)
        faces[rows] = np.where((facing < 0)[:, None], part[:, ::-1], part)
    return replace(triangles, faces=faces)


def _with_computed_normals(triangles: Triangles, missing: np.ndarray) -> Triangles:
    chosen = missing[triangles.faces].any(axis=1)
    faces = triangles.faces[chosen]
    corners = faces.reshape(-1)
    normals = corner_normals(triangles.vertices, faces)
    keeps_own = ~missing[corners]
    normals[keeps_own] = triangles.normals[corners[keeps_own]]

    # Corners become one vertex again where position, texture, color and normal are the same.
    _, kinds = unique_rows([*triangles.vertices.T, *triangles.uvs.T, *triangles.colors.T])
    rounded = np.round(normals / SAME_NORMAL).astype(np.int16)  # the normals have unit length
    first, inverse = unique_rows([kinds[corners], *rounded.T])
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
    unit, angles = np.empty((len(faces), 3)), np.empty((len(faces), 3))
    for rows in batches(len(faces)):
        unit[rows] = face_normals(vertices, faces[rows])
        unit[rows] /= np.maximum(np.linalg.norm(unit[rows], axis=1, keepdims=True), 1e-300)
        angles[rows] = _corner_angles(vertices, faces[rows])
    angles = angles.reshape(-1, 1)

    # Corners sorted by position: those of one position are contiguous, [start, start + count).
    _, place_of_vertex = unique_rows([*vertices.T])
    place = place_of_vertex[faces.reshape(-1)]
    order = np.argsort(place, kind="stable").astype(np.int32)
    counts = np.bincount(place)
    starts = np.cumsum(counts) - counts
    rank = np.empty(len(place), np.int32)
    for rows in batches(len(order)):
        corners = order[rows]
        rank[corners] = np.arange(rows.start, rows.stop) - starts[place[corners]]

    total = np.empty((len(place), 3))
    cosine = np.cos(np.radians(CREASE_DEGREES))
    for rows in batches(len(place)):
        corners = np.arange(rows.start, rows.stop)
        own, places = unit[corners // 3], place[corners]
        sums = own * angles[corners]
        # Step k adds to every corner the k-th next one at its position.
        for step in range(1, min(counts[places].max(), MOST_AT_A_PLACE)):
            here = np.flatnonzero(counts[places] > step)
            group = places[here]
            other = order[starts[group] + (rank[corners[here]] + step) % counts[group]]
            smooth = np.einsum("ij,ij->i", own[here], unit[other // 3]) > cosine
            other = other[smooth]
            sums[here[smooth]] += unit[other // 3] * angles[other]
        total[corners] = sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-300)
    return total


def _corner_angles(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the inner angles of the triangles [rad], shape (m, 3)."""
    corners = vertices[faces]
    to_next = np.roll(corners, -1, axis=1) - corners
    to_last = np.roll(corners, 1, axis=1) - corners
    cross = np.linalg.norm(np.cross(to_next, to_last), axis=2)
    return np.arctan2(cross, (to_next * to_last).sum(axis=2))


def batches(count: int) -> Iterator[slice]:
    """Yield the rows 0 to ``count`` in pieces: what is computed of all at once takes gigabytes."""
    for start in range(0, count, _ROWS_AT_A_TIME):
        yield slice(start, min(start + _ROWS_AT_A_TIME, count))


def unique_rows(columns: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the index of the first occurrence of each unique row, and the unique row of every row.

    Unique rows are sorted by the last column, then by the one before it, and so on.
    """
    order = np.lexsort(columns)
    is_new = np.zeros(len(order), bool)
    is_new[:1] = True
    for column in columns:
        ordered = column[order]
        is_new[1:] |= ordered[1:] != ordered[:-1]
    inverse = np.empty(len(order), np.int32)
    inverse[order] = np.cumsum(is_new, dtype=np.int32) - 1
    return order[is_new], inverse
