"""Openness of meshes with many faces: rays from a part of the nodes; the others get a mean of those around.

A scan of a million faces has more nodes than an image has pixels: rays from all of them take longer than the
photographs, and the few that each can have show as grain. Openness hardly changes over some thousandths of an
object.
"""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false
# pyright: reportIndexIssue=false

from dataclasses import dataclass

import numpy as np
import warp as wp

from digs_warp.device.parallel import launch_parallel
from digs_warp.sim.scene.scene import Scene

wp.set_module_options({"enable_backward": False})

# The surface is divided into about this many cells, and each by layers and by the octants of the normals.
CELLS = 60_000
LAYERS = 16

# Nodes of faces with a longer side are measured themselves, in widths of a cell.
LONG_SIDE = 3.0

# Samples count up to this distance from a node, in widths of a cell: the one in its own cell always does.
REACH = wp.constant(2.0)

# Surfaces this far above each other are different ones: leather under a buckle. In widths of a cell.
LAYER = wp.constant(0.3)

# Weight of a sample whose normal is square to that of the node.
LEAST_WEIGHT = wp.constant(1.0e-4)

# Cells of the grid in which samples are looked up, along each side; it repeats.
GRID = 64


@dataclass(frozen=True, eq=False)
class Samples:
    """Which of n nodes are measured.

    Attributes:
        measured: their indices, ascending, int64.
        around: which of ``measured`` count for the nodes around them: those of no large face, bool.
        spacing: width of a cell [m].
    """

    measured: np.ndarray
    around: np.ndarray
    spacing: float


def choose_samples(
    scene: Scene, points: np.ndarray, normals: np.ndarray, nodes: np.ndarray
) -> Samples:
    """Return the nodes to measure.

    Args:
        scene: with the faces of the nodes.
        points: of the nodes, shape (n, 3).
        normals: likewise.
        nodes: those of each face, shape (m, 6).
    """
    corners = scene.vertices[scene.faces].astype(np.float64)
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    area = (
        np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        ).sum()
        / 2
    )
    spacing = float(np.sqrt(area / CELLS))
    is_large = np.zeros(len(points), bool)
    is_large[nodes[sides.max(axis=1) > LONG_SIDE * spacing]] = True

    small = np.flatnonzero(~is_large)
    cell = np.floor((points[small] - points.min(axis=0)) / spacing).astype(np.int64)
    across = cell.max(axis=0, initial=0) + 1
    signs = np.where(normals[small] > 0, 1, -1)
    height = (points[small] * signs).sum(axis=1) / np.sqrt(3)
    layer = np.floor(height / (float(LAYER) * spacing)).astype(np.int64) % LAYERS
    octant = (signs > 0) @ np.array([1, 2, 4])
    key = (cell[:, 0] * across[1] + cell[:, 1]) * across[2] + cell[:, 2]
    key = (key * 8 + octant) * LAYERS + layer
    chosen = np.zeros(len(points), bool)
    chosen[small[np.unique(key, return_index=True)[1]]] = True
    measured = np.flatnonzero(chosen | is_large)
    return Samples(measured, chosen[measured], spacing)


@wp.kernel
def _fill_kernel(
    first: int,
    points: wp.array[wp.vec3],  # [nodes]
    normals: wp.array[wp.vec3],  # [nodes]
    grid: wp.uint64,
    spacing: float,
    sample_points: wp.array[wp.vec3],  # [samples]
    sample_normals: wp.array[wp.vec3],  # [samples]
    sample_values: wp.array[wp.vec2],  # [samples]
    # outputs
    values: wp.array[wp.vec2],  # [nodes]
):
    """Give each node the mean of the samples around it, weighted by nearness and by their normals."""
    node = first + wp.tid()
    point = points[node]
    normal = normals[node]
    reach = REACH * spacing
    total = wp.vec2(0.0, 0.0)
    weights = wp.float32(0.0)
    query = wp.hash_grid_query(grid, point, reach)
    i = int(0)
    while wp.hash_grid_query_next(query, i):
        way = sample_points[i] - point
        distance = wp.length(way)
        if distance < reach:
            nearness = 1.0 - distance / reach
            facing = wp.max(wp.dot(sample_normals[i], normal), 0.0)
            above = wp.max(wp.abs(wp.dot(way, normal)), wp.abs(wp.dot(way, sample_normals[i])))
            layers = above / (LAYER * spacing)
            weight = nearness * nearness * wp.exp(-layers * layers)
            weight *= facing * facing * facing * facing + LEAST_WEIGHT
            total += weight * sample_values[i]
            weights += weight
    values[node] = total / wp.max(weights, 1.0e-30)


def fill_between(
    samples: Samples, points: np.ndarray, normals: np.ndarray, measured: np.ndarray, threads: int
) -> np.ndarray:
    """Return the values of all nodes, shape (n, 2), float32.

    Args:
        samples: which nodes were measured.
        points: of all nodes, shape (n, 3), float32.
        normals: likewise.
        measured: values of the measured ones, shape (k, 2), float32.
        threads: 0: all cores.
    """
    around = samples.measured[samples.around]
    vectors = [
        wp.array(array, dtype=wp.vec3, device="cpu")
        for array in (points, normals, points[around], normals[around])
    ]
    grid = wp.HashGrid(GRID, GRID, GRID, device="cpu")
    grid.build(vectors[2], float(REACH) * samples.spacing)
    known = wp.array(measured[samples.around], dtype=wp.vec2, device="cpu")
    values = wp.empty(len(points), dtype=wp.vec2, device="cpu")
    inputs = [*vectors[:2], grid.id, samples.spacing, *vectors[2:], known, values]
    launch_parallel(_fill_kernel, len(points), inputs, threads=threads)
    filled = values.numpy()
    filled[samples.measured] = measured
    return filled
