"""Connected parts of a mesh: the object stays, floaters go."""

from dataclasses import dataclass

import numpy as np

from digs_warp.data.triangle_mesh import TriangleMesh

# Parts with less than this share of the triangles of the largest one are floaters.
LEAST_SHARE = 0.02


@dataclass(frozen=True, eq=False)
class Cleaned:
    """A mesh without floaters, and how many parts and triangles were taken out."""

    mesh: TriangleMesh
    removed_parts: int
    removed_triangles: int


def remove_floaters(mesh: TriangleMesh, least_share: float = LEAST_SHARE) -> Cleaned:
    """Return the parts that are at least ``least_share`` as large as the largest, by triangles.

    Parts are connected through shared vertices. ``least_share`` of 1 keeps the largest alone.
    """
    if not len(mesh):
        return Cleaned(mesh, 0, 0)
    parts = triangle_parts(mesh)
    sizes = np.bincount(parts)
    kept = sizes >= least_share * sizes.max()
    chosen = mesh.triangles[kept[parts]]
    used = np.zeros(len(mesh.points_world), dtype=bool)
    used[chosen] = True
    numbers = np.cumsum(used) - 1
    smaller = TriangleMesh(mesh.points_world[used], numbers[chosen], mesh.colors[used])
    # Vertices without a triangle are parts of their own in the graph: they do not count.
    removed = int(np.count_nonzero(~kept & (sizes > 0)))
    return Cleaned(smaller, removed, len(mesh) - len(smaller))


def triangle_parts(mesh: TriangleMesh) -> np.ndarray:
    """Return the number of the part of each triangle, shape (m,), int."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    a, b, c = mesh.triangles.T
    rows, columns = np.concatenate([a, b]), np.concatenate([b, c])
    count = len(mesh.points_world)
    graph = coo_array((np.ones(len(rows), dtype=bool), (rows, columns)), shape=(count, count))
    _, part_of_vertex = connected_components(graph, directed=False)
    return part_of_vertex[a]
