"""Openness: the share of a hemisphere that sees the surround, at the vertices and edge midpoints of a mesh.

Between these nodes it is a quadratic over each triangle (the six-node triangle of Zienkiewicz, "The Finite
Element Method"): the middle of a large face stays bright even if all its corners lie in dark ones.

A scan of a million faces has more nodes than an image has pixels. Openness hardly changes over some
thousandths of an object: one node of each small cell is measured, and the others are means of those around.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.device.kernel_options import ray_module_options
from digs_warp.device.parallel import launch_parallel
from digs_warp.sim.render.surface import Surface, is_blocked
from digs_warp.sim.render.surround import openness_on, plane_distance
from digs_warp.sim.scene.scene import Scene

wp.set_module_options(ray_module_options())

GOLDEN_ANGLE = wp.constant(2.399963229728653)
GOLDEN_RATIO = wp.constant(0.6180339887498949)

# A ray to the ground ends this share of its length before it: a table top is a surface, too.
BEFORE = wp.constant(0.999)

# Rays per node and side; large meshes divide the budget.
RAYS = 64
RAY_BUDGET = 2_000_000
MIN_RAYS = 8
GLANCE = wp.constant(4)

# Of meshes with more nodes, one is measured in each cell of about this part of the surface, with more rays.
MOST_NODES = 400_000
CELLS = 60_000
CELLS_BUDGET = 4_000_000

# Surfaces this far above each other have cells of their own (leather under a buckle), and so have nodes of
# faces with a longer side than this. In widths of a cell.
LAYER, LAYERS = 0.3, 16
LONG_SIDE = 3.0

# How often the values of cells are averaged along edges: a cell of a scan is about six edges wide.
SMOOTHINGS = 10

# Occluders farther away than this share of the scene's radius do not darken a surface.
REACH = 0.7

# Share of the path from a node to the middle of its face along which its openness is measured.
INSET = wp.constant(0.6)

# Corners of the edges of a triangle, in the order of the edge nodes.
EDGES = ((0, 1), (1, 2), (2, 0))


@dataclass(frozen=True, eq=False)
class OpennessNodes:
    """The n vertices of a scene, then its e edges.

    Attributes:
        points: positions, (n + e, 3), float32.
        inward: vector from there to the middle of their largest face, (n + e, 3), float32.
        normals: on the side of the vertex normals, (n + e, 3), float32; length 0: no direction.
        edges: node of each edge of each face, (m, 3), int32.
        ends: vertices of each edge, (e, 2), int64.
    """

    points: np.ndarray
    inward: np.ndarray
    normals: np.ndarray
    edges: np.ndarray
    ends: np.ndarray


def openness_nodes(scene: Scene) -> OpennessNodes:
    """Return the nodes of a scene's faces."""
    count = len(scene.vertices)
    pairs = np.sort(scene.faces[:, EDGES].reshape(-1, 2), axis=1)
    keys, number = np.unique(pairs @ np.array([count, 1]), return_inverse=True)
    ends = np.stack(np.divmod(keys, count), axis=1)
    edges = (count + number.reshape(-1, len(EDGES))).astype(np.int32)

    corners = scene.vertices[scene.faces].astype(np.float64)
    sides = corners[:, 1:] - corners[:, :1]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    places = np.concatenate([corners, corners[:, EDGES].mean(axis=2)], axis=1)
    ways = corners.mean(axis=1, keepdims=True) - places
    nodes = np.concatenate([scene.faces, edges], axis=1)
    smallest_first = np.argsort(area, kind="stable")
    points = np.concatenate([scene.vertices, scene.vertices[ends].mean(axis=1)])
    inward = np.zeros(points.shape)
    # The last write to a node wins: that of its largest face.
    inward[nodes[smallest_first].reshape(-1)] = ways[smallest_first].reshape(-1, 3)

    normals = scene.normals[ends].sum(axis=1)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 1e-6, normals / np.maximum(length, 1e-6), 0.0)
    normals = np.concatenate([scene.normals, normals])
    points, inward, normals = (a.astype(np.float32) for a in (points, inward, normals))
    return OpennessNodes(points, inward, normals, edges, ends)


@wp.func
def open_share(
    surface: Surface, point: wp.vec3, inward: wp.vec3, normal: wp.vec3, rays: int, reach: float
) -> float:
    """Cosine-weighted share of a hemisphere whose rays leave the object within ``reach`` [m].

    Rays that meet the ground on their way count as much as light reaches it there. The rays start along part
    of the vector ``inward``: a corner, or a small part that stands on a large face, must not darken the whole
    face.
    """
    helper = wp.where(wp.abs(normal[2]) < 0.9, wp.vec3(0.0, 0.0, 1.0), wp.vec3(1.0, 0.0, 0.0))
    tangent = wp.normalize(wp.cross(helper, normal))
    bitangent = wp.cross(normal, tangent)
    free = wp.float32(0.0)
    for i in range(rays):
        # Malley's method: a sunflower on the disk, lifted to the hemisphere.
        radius2 = (float(i) + 0.5) / float(rays)
        angle = float(i) * GOLDEN_ANGLE
        place = float(i) * GOLDEN_RATIO + 0.5
        start = point + INSET * (place - wp.floor(place)) * inward
        radius = wp.sqrt(radius2)
        direction = (
            radius * (wp.cos(angle) * tangent + wp.sin(angle) * bitangent)
            + wp.sqrt(1.0 - radius2) * normal
        )
        ahead = reach
        light = wp.float32(1.0)
        down = plane_distance(surface.table, start, direction, 2.0 * surface.lift)
        if down >= 0.0 and down < ahead:
            meets = start + down * direction
            light = openness_on(surface.table, meets[0], meets[1])
            ahead = down * BEFORE
        down = plane_distance(surface.floor, start, direction, 2.0 * surface.lift)
        if down >= 0.0 and down < ahead:
            meets = start + down * direction
            light = openness_on(surface.floor, meets[0], meets[1])
            ahead = down * BEFORE
        if not is_blocked(surface, start, direction, ahead):
            free += light
    return free / float(rays)


@wp.kernel
def _openness_kernel(
    first: int,
    surface: Surface,
    points: wp.array[wp.vec3],  # [nodes]
    inward: wp.array[wp.vec3],  # [nodes] vector to the middle of the face
    normals: wp.array[wp.vec3],  # [nodes]
    rays: int,
    reach: float,
    # outputs
    openness: wp.array[wp.vec2],
):
    """Measure the openness of a node on both sides of the surface."""
    node = first + wp.tid()
    point = points[node]
    normal = normals[node]
    offset = surface.lift
    if wp.length(normal) < 0.5:
        normal = wp.vec3(0.0, 0.0, 1.0)
    way = inward[node]
    front = open_share(surface, point + offset * normal, way, normal, rays, reach)
    # Bodies are closed: few rays tell that nothing is open inside.
    behind = point - offset * normal
    back = open_share(surface, behind, way, -normal, wp.min(rays, GLANCE), reach)
    if back > 0.0:
        back = open_share(surface, behind, way, -normal, rays, reach)
    openness[node] = wp.vec2(front, back)


def measure_openness(scene: Scene, surface: Surface, threads: int = 0) -> None:
    """Measure the openness of a scene and add it to its ``surface``; ``threads`` 0: all cores."""
    nodes = openness_nodes(scene)
    reach = REACH * scene.object_radius
    if len(nodes.points) <= MOST_NODES:
        openness = _measured(nodes, slice(None), surface, reach, RAY_BUDGET, threads)
    else:
        chosen, cell_of = _cells(scene, nodes)
        known = _measured(nodes, chosen, surface, reach, CELLS_BUDGET, threads)
        openness = _filled(known[cell_of], nodes, chosen)
    surface.openness = wp.array(openness, dtype=wp.vec2, device="cpu")
    surface.edges = wp.array(nodes.edges.reshape(-1), dtype=int, device="cpu")


def _cells(scene: Scene, nodes: OpennessNodes) -> tuple[np.ndarray, np.ndarray]:
    """Return the node that is measured in each cell, (c,), and the cell of each node, (n + e,).

    A cell holds nodes that are near each other, in the same layer, and whose normals are in the same octant.
    """
    corners = scene.vertices[scene.faces].astype(np.float64)
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    width = np.sqrt(np.linalg.norm(across, axis=1).sum() / 2 / CELLS)
    place = np.floor((nodes.points - nodes.points.min(axis=0)) / width).astype(np.int64)
    signs = np.where(nodes.normals > 0, 1, -1)
    height = (nodes.points * signs).sum(axis=1) / np.sqrt(3)
    layer = np.floor(height / (LAYER * width)).astype(np.int64) % LAYERS
    key = np.ravel_multi_index(
        (*place.T, *(signs.T > 0), layer), (*place.max(axis=0) + 1, 2, 2, 2, LAYERS)
    )
    is_long = sides.max(axis=1) > LONG_SIDE * width
    alone = np.unique([scene.faces[is_long], nodes.edges[is_long]])
    key[alone] = -1 - alone
    _, chosen, cell_of = np.unique(key, return_index=True, return_inverse=True)
    return chosen, cell_of


def _filled(values: np.ndarray, nodes: OpennessNodes, known: np.ndarray) -> np.ndarray:
    """Return values of the nodes, (n + e, 2), averaged along the edges but for those that are known."""
    ends, count = nodes.ends, len(nodes.points) - len(nodes.ends)
    degree = np.maximum(np.bincount(ends.reshape(-1), minlength=count), 1)
    smooth = values.copy()
    for _ in range(SMOOTHINGS):
        for side in range(2):
            around = np.repeat(smooth[count:, side], 2)
            smooth[:count, side] = np.bincount(ends.reshape(-1), around, count) / degree
        smooth[known] = values[known]
        smooth[count:] = smooth[ends].mean(axis=1)
        smooth[known] = values[known]
    return smooth


def _measured(
    nodes: OpennessNodes,
    which: np.ndarray | slice,
    surface: Surface,
    reach: float,
    budget: int,
    threads: int,
) -> np.ndarray:
    """Return the openness of some nodes on both sides, shape (k, 2), float32; ``budget``: rays for all."""
    places = [
        wp.array(array[which], dtype=wp.vec3, device="cpu")
        for array in (nodes.points, nodes.inward, nodes.normals)
    ]
    count = len(places[0])
    rays = int(np.clip(budget // (2 * count), MIN_RAYS, RAYS))
    openness = wp.empty(count, dtype=wp.vec2, device="cpu")
    launch_parallel(
        _openness_kernel, count, [surface, *places, rays, reach, openness], threads=threads
    )
    return openness.numpy()
